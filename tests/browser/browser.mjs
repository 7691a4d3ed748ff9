// Chromium, and pages that report what must not happen.

import { execFileSync } from "node:child_process";
import { chromium } from "playwright-core";

const NAMES = ["chromium", "chromium-browser", "google-chrome"];

function find() {
  for (const name of NAMES) {
    try {
      return execFileSync("which", [name], { encoding: "utf8" }).trim();
    } catch {
      // The next name may exist.
    }
  }
  throw new Error(`Chromium is needed: none of ${NAMES.join(", ")} was found`);
}

export async function startBrowser() {
  // Without its sandbox, because containers often forbid it. The tests open no page but the server's own.
  return chromium.launch({ executablePath: find(), args: ["--no-sandbox"] });
}

/**
 * Drops pictures on the page: 160×96 px, black with a white square from column 40 and row 20 on, which has 60×50 px in the
 * first picture and a column less in each next one.
 */
export async function dropSquare(page, names = ["square.png"]) {
  await page.evaluate(async (names) => {
    const data = new DataTransfer();
    for (const [i, name] of names.entries()) {
      const canvas = new OffscreenCanvas(160, 96);
      const context = canvas.getContext("2d");
      context.fillStyle = "white";
      context.fillRect(40, 20, 60 - i, 50);
      data.items.add(new File([await canvas.convertToBlob({ type: "image/png" })], name, { type: "image/png" }));
    }
    document.dispatchEvent(new DragEvent("drop", { dataTransfer: data, bubbles: true, cancelable: true }));
  }, names);
}

/** Opens a page. `page.problems` collects errors of its scripts, of its policy, and requests to other hosts. */
export async function openPage(browser, url, { width = 1280, height = 900, scheme = "dark" } = {}) {
  const context = await browser.newContext({ viewport: { width, height }, colorScheme: scheme });
  const page = await context.newPage();
  page.setDefaultTimeout(20_000);
  page.problems = [];
  page.on("console", (message) => message.type() === "error" && page.problems.push(message.text()));
  page.on("pageerror", (error) => page.problems.push(error.message));
  page.on("request", (request) => {
    const target = request.url();
    if (!target.startsWith(url) && !target.startsWith("blob:") && !target.startsWith("data:")) page.problems.push(`a request to ${target}`);
  });
  return page;
}
