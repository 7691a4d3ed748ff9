// A server of the test's own, on a copy of the demo's data.

import { execFileSync, spawn } from "node:child_process";
import { cpSync, mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";

const PROGRAM = join(process.env.LIGHTPATH_BINARIES, "lightpathd");

/** Creates a token, and returns it. */
export function createToken(dataDir, name, role) {
  return execFileSync(PROGRAM, ["token", "create", name, "--role", role, "--data-dir", dataDir], { encoding: "utf8", stdio: ["ignore", "pipe", "ignore"] }).trim();
}

/** Starts a server after `prepare(dataDir)`. */
export async function startServer({ flags = [], prepare = () => {} } = {}) {
  const folder = mkdtempSync(join(tmpdir(), "lightpath-browser-"));
  const dataDir = join(folder, "data");
  cpSync(process.env.LIGHTPATH_DEMO_DATA, dataDir, { recursive: true });
  prepare(dataDir);
  let [child, url] = await run("127.0.0.1:0");

  async function run(address) {
    const child = spawn(PROGRAM, ["serve", "--data-dir", dataDir, "--listen", address, ...flags], { stdio: ["ignore", "pipe", "pipe"] });
    const url = await new Promise((found, failed) => {
      let text = "";
      const read = (chunk) => {
        text += chunk;
        const listening = text.match(/listening on (http:\/\/\S+)/);
        if (listening) found(listening[1]);
      };
      child.stdout.on("data", read);
      child.stderr.on("data", read);
      child.on("exit", (code) => failed(new Error(`the server ended with ${code}: ${text}`)));
    });
    return [child, url];
  }

  async function end(signal) {
    const ended = new Promise((done) => child.once("exit", done));
    child.kill(signal);
    await ended;
  }

  return {
    url,
    dataDir,
    get pid() {
      return child.pid;
    },
    /** Kills the server, waits for `down`, and starts it again at the same address. */
    async restart(down) {
      await end("SIGKILL");
      await down();
      [child] = await run(new URL(url).host);
    },
    async stop() {
      await end("SIGTERM");
      rmSync(folder, { recursive: true, force: true });
    },
    async get(path) {
      return (await fetch(`${url}/v1/${path}`)).json();
    },
    async post(path, message) {
      const headers = { "content-type": "application/json" };
      const response = await fetch(`${url}/v1/${path}`, { method: "POST", headers, body: JSON.stringify(message) });
      if (!response.ok) throw new Error(`${path} was refused: ${await response.text()}`);
      return response.json();
    },
  };
}
