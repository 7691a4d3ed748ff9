// The program of the page: which page is shown, the theme, and the connection.

import { forgetCaller, mayNot } from "./access.js";
import { hasToken, onSignInNeeded, setToken } from "./api.js";
import { h, show } from "./dom.js";
import { onConnection, start, stop } from "./events.js";
import { apiPage } from "./pages/api.js";
import { batchPage } from "./pages/batch.js";
import { comparePage } from "./pages/compare.js";
import { datasetPage } from "./pages/dataset.js";
import { datasetsPage } from "./pages/datasets.js";
import { displayPage } from "./pages/display.js";
import { displaysPage } from "./pages/displays.js";
import { jobPage } from "./pages/job.js";
import { jobsPage } from "./pages/jobs.js";
import { kernelPage } from "./pages/kernel.js";
import { acceptDrops, newPage } from "./pages/new.js";
import { overviewPage } from "./pages/overview.js";
import { signInPage } from "./pages/sign_in.js";
import { wallPage } from "./pages/wall.js";
import { startTheme } from "./theme.js";

/** Pages by the form of their address. Each fills an element, and returns a function that ends its work. */
const ROUTES = [
  [/^\/$/, overviewPage, "Overview"],
  [/^\/jobs$/, jobsPage, "Jobs"],
  [/^\/jobs\/([^/]+)$/, jobPage, "Job"],
  [/^\/batch\/([^/]+)$/, batchPage, "Batch"],
  [/^\/compare$/, comparePage, "Compare"],
  [/^\/datasets$/, datasetsPage, "Datasets"],
  [/^\/datasets\/([^/]+)$/, datasetPage, "Dataset"],
  [/^\/new$/, newPage, "New hologram"],
  [/^\/wall$/, wallPage, "Wall"],
  [/^\/api$/, apiPage, "API"],
  [/^\/displays$/, displaysPage, "Displays"],
  [/^\/displays\/([^/]+)$/, displayPage, "Display"],
  [/^\/displays\/([^/]+)\/kernels\/([^/]+)$/, kernelPage, "Kernel"],
];

const main = document.getElementById("main");
const connection = document.getElementById("connection");
const signOut = document.getElementById("sign-out");
let leave = () => {};

function open() {
  leave();
  leave = () => {};
  const [path, query = ""] = (location.hash.slice(1) || "/").split("?");
  const found = ROUTES.map(([form, page, title]) => ({ match: path.match(form), page, title })).find(({ match }) => match);
  document.title = `${found?.title ?? "Not found"} – Lightpath`;
  for (const link of document.querySelectorAll("header nav a")) {
    const target = link.hash.slice(1);
    const isHere = target === path || (target !== "/" && path.startsWith(`${target}/`));
    if (isHere) link.setAttribute("aria-current", "page");
    else link.removeAttribute("aria-current");
  }
  const root = h("div", { class: "page" });
  show(main, root);
  if (!found) {
    show(root, h("h1", {}, "This page does not exist"), h("p", {}, h("a", { href: "#/" }, "To the overview")));
    return;
  }
  leave = found.page(root, found.match.slice(1).map(decodeURIComponent), new URLSearchParams(query)) ?? (() => {});
}

/** Leads nobody to the form who may not submit it. */
function showNavigation() {
  const link = document.querySelector('header nav a[href="#/new"]');
  void mayNot("submit").then((refusal) => { link.hidden = refusal !== ""; });
}

function signIn() {
  if (main.querySelector("#sign-in")) return;
  leave();
  stop();
  const wasWrong = hasToken();
  setToken("");
  forgetCaller();
  signOut.hidden = true;
  connection.textContent = "";
  const root = h("div", { class: "page" });
  show(main, root);
  leave = () => {};
  signInPage(root, wasWrong, () => {
    signOut.hidden = false;
    showNavigation();
    start();
    open();
  });
}

window.addEventListener("hashchange", () => {
  if (main.querySelector("#sign-in")) return;
  open();
  main.focus({ preventScroll: true });
  scrollTo(0, 0);
});
signOut.addEventListener("click", () => {
  setToken("");
  signIn();
});
onSignInNeeded(() => queueMicrotask(signIn));
onConnection((isConnected) => {
  connection.className = isConnected ? "live" : "lost";
  connection.textContent = isConnected ? "live" : "connection lost, trying again";
});
acceptDrops(() => {
  if (location.hash === "#/new") dispatchEvent(new Event("picturedrop"));
  else location.hash = "#/new";
});
startTheme(document.getElementById("theme"));
start();
showNavigation();
open();
