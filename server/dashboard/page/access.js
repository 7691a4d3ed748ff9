// What the caller may do, so that nobody is offered what the server would refuse.

import { get } from "./api.js";

/** Roles that may do each thing, as the server has them. */
const ROLES = {
  submit: ["submitter", "curator", "admin"],
  curate: ["curator", "admin"],
  administer: ["admin"],
};

let caller = null;

/** Forgets who calls: another token, or none, is used from now on. */
export function forgetCaller() {
  caller = null;
}

/** Why the caller may not do this, as a sentence; empty: nothing is known against it. */
export async function mayNot(what) {
  caller ??= get("server").catch((error) => {
    caller = null;
    throw error;
  });
  // Whoever cannot ask finds out from the refusal of the server.
  const role = await caller.then((server) => server.role, () => "");
  if (!role || ROLES[what].includes(role)) return "";
  const needed = ROLES[what];
  return `Your token has the role ${role}; this needs the role ${needed.length > 1 ? `${needed.slice(0, -1).join(", ")} or ` : ""}${needed.at(-1)}.`;
}

/** Disables a button that the caller may not use, and says why. Returns the button. */
export function guarded(button, what) {
  mayNot(what).then((refusal) => {
    if (!refusal) return;
    button.disabled = true;
    button.title = refusal;
  });
  return button;
}
