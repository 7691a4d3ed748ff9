// Buttons that turn the pages of a list.

import { h } from "./dom.js";

/**
 * Buttons for the pages before and after this one; `null` if there is only one.
 *
 * `tokens` has the tokens of the pages up to this one, and is changed by the buttons. `refresh` shows the page anew.
 */
export function pager(tokens, nextPageToken, refresh) {
  if (tokens.length === 1 && !nextPageToken) return null;
  const turn = (label, isPossible, move) => h("button", { type: "button", "data-key": label, disabled: !isPossible, onclick: () => {
    move();
    void refresh();
  } }, label);
  return h("p", { class: "pager" }, turn("Previous page", tokens.length > 1, () => tokens.pop()), `Page ${tokens.length}`,
    turn("Next page", nextPageToken, () => tokens.push(nextPageToken)));
}
