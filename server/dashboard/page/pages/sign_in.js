// The page that asks for a token.

import { ApiError, get, setToken } from "../api.js";
import { h, show } from "../dom.js";

export function signInPage(root, wasWrong, onSignedIn) {
  const field = h("input", { id: "token", type: "password", autocomplete: "off", spellcheck: "false", required: true, "aria-describedby": "token-help" });
  const message = h("p", { class: "bad", role: "alert" }, wasWrong ? "The server did not accept this token." : "");
  const form = h("form", { id: "sign-in", onsubmit: submit },
    h("h1", {}, "Sign in"),
    h("label", { for: "token" }, "Token"), field,
    h("button", { type: "submit", class: "main" }, "Sign in"), message,
    h("p", { id: "token-help" }, "An admin makes tokens on the server. The page forgets the token when you close or reload it."),
    h("pre", {}, h("code", {}, "lightpathd token create wall --role viewer")));
  async function submit(event) {
    event.preventDefault();
    setToken(field.value.trim());
    try {
      await get("displays", { pageSize: 1 });
    } catch (error) {
      if (!(error instanceof ApiError) || error.status !== 403) {
        setToken("");
        message.textContent = error.status === 401 ? "The server did not accept this token." : error.message;
        field.focus();
        return;
      }
    }
    form.remove();
    onSignedIn();
  }
  show(root, form);
  field.focus();
}
