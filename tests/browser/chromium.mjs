// Drives a headless Chromium through its debugging pipe; needs nothing but Node.

import { spawn } from "node:child_process";
import { mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";

const SECOND = 1000;

export class Chromium {
  /** Starts a browser with one page of this size. */
  static async start(program, { width, height, dark }) {
    const profile = mkdtempSync(join(tmpdir(), "painleve-chromium-"));
    const process_ = spawn(program, [
      "--headless=new", "--no-sandbox", "--remote-debugging-pipe", "--no-first-run", "--disable-gpu", "--disable-background-networking",
      "--disable-dev-shm-usage", "--hide-scrollbars", `--user-data-dir=${profile}`, "about:blank",
    ], { stdio: ["ignore", "ignore", "ignore", "pipe", "pipe"] });
    const browser = new Chromium();
    Object.assign(browser, { process_, profile, next: 1, waiting: new Map(), problems: [] });
    let text = "";
    process_.stdio[4].on("data", (data) => {
      text += data;
      const messages = text.split("\0");
      text = messages.pop();
      for (const message of messages) browser.receive(JSON.parse(message));
    });
    const { targetInfos } = await browser.send("Target.getTargets");
    const page = targetInfos.find(({ type }) => type === "page");
    const { sessionId } = await browser.send("Target.attachToTarget", { targetId: page.targetId, flatten: true });
    browser.session = sessionId;
    await browser.send("Runtime.enable");
    await browser.send("Log.enable");
    await browser.send("Page.enable");
    await browser.resize(width, height);
    await browser.send("Emulation.setEmulatedMedia", { features: [{ name: "prefers-color-scheme", value: dark ? "dark" : "light" }] });
    return browser;
  }

  receive(message) {
    const waiting = this.waiting.get(message.id);
    if (waiting) {
      this.waiting.delete(message.id);
      if (message.error) waiting.reject(new Error(message.error.message)); else waiting.resolve(message.result);
    }
    const { method, params } = message;
    if (method === "Runtime.exceptionThrown") this.problems.push(params.exceptionDetails.exception?.description ?? params.exceptionDetails.text);
    if (method === "Runtime.consoleAPICalled" && ["error", "warning"].includes(params.type)) this.problems.push(params.args.map((a) => a.value ?? a.description).join(" "));
    if (method === "Log.entryAdded" && ["error", "warning"].includes(params.entry.level)) this.problems.push(`${params.entry.text} ${params.entry.url ?? ""}`);
  }

  send(method, params = {}) {
    const id = this.next++;
    this.process_.stdio[3].write(`${JSON.stringify({ id, method, params, sessionId: this.session })}\0`);
    return new Promise((resolve, reject) => {
      this.waiting.set(id, { resolve, reject });
      setTimeout(() => reject(new Error(`${method}: no answer for 60 s`)), 60 * SECOND).unref();
    });
  }

  resize(width, height) {
    return this.send("Emulation.setDeviceMetricsOverride", { width, height, deviceScaleFactor: 1, mobile: false });
  }

  open(url) { return this.send("Page.navigate", { url }); }

  /** Value of an expression on the page. */
  async evaluate(expression) {
    const { result, exceptionDetails } = await this.send("Runtime.evaluate", { expression, awaitPromise: true, returnByValue: true });
    if (exceptionDetails) throw new Error(exceptionDetails.exception?.description ?? exceptionDetails.text);
    return result.value;
  }

  /** Waits until an expression is true. */
  async until(expression, what = expression) {
    for (let tries = 0; tries < 400; tries++) {
      if (await this.evaluate(`Boolean(${expression})`).catch(() => false)) return;
      await pause(50);
    }
    throw new Error(`not within 20 s: ${what}`);
  }

  /** Clicks the middle of an element, as a mouse does. */
  async click(selector) {
    const at = await this.evaluate(`(() => { const e = document.querySelector(${JSON.stringify(selector)}); e.scrollIntoView({ block: "center" }); const b = e.getBoundingClientRect(); return { x: b.x + b.width / 2, y: b.y + b.height / 2 }; })()`);
    for (const type of ["mousePressed", "mouseReleased"]) await this.send("Input.dispatchMouseEvent", { type, ...at, button: "left", clickCount: 1 });
  }

  async key(key) {
    const text = key.length === 1 ? key : undefined;
    await this.send("Input.dispatchKeyEvent", { type: "keyDown", key, text });
    await this.send("Input.dispatchKeyEvent", { type: "keyUp", key });
  }

  /** Ends the test if the page shows an error or the console contains one. */
  async quiet(what) {
    const shown = await this.evaluate("[...document.querySelectorAll('.error')].map((e) => e.textContent).join('')");
    check(shown === "", `no error is shown ${what}${shown && `: ${shown}`}`);
    check(this.problems.length === 0, `the console is empty ${what} ${this.problems.join("; ")}`);
  }

  /** Sets a field or a choice, as a user does. */
  set(selector, value) {
    return this.evaluate(`(() => { const e = document.querySelector(${JSON.stringify(selector)}); e.value = ${JSON.stringify(value)}; e.dispatchEvent(new Event("change")); })()`);
  }

  /** A picture of the whole page as PNG. */
  async picture(full = true) {
    return Buffer.from((await this.send("Page.captureScreenshot", { format: "png", captureBeyondViewport: full })).data, "base64");
  }

  async close() {
    const ended = new Promise((resolve) => this.process_.once("exit", resolve));
    this.send("Browser.close").catch(() => {});
    setTimeout(() => this.process_.kill("SIGKILL"), 5 * SECOND).unref();
    await ended;
    rmSync(this.profile, { recursive: true, force: true, maxRetries: 5 });
  }
}

export function pause(ms) { return new Promise((resolve) => setTimeout(resolve, ms)); }

/** Prints what holds; ends the test with it otherwise. */
export function check(holds, what) {
  if (!holds) throw new Error(what);
  console.log(`ok: ${what}`);
}
