// Measures the labels of pictures in headless Chromium: node pictures.mjs CHROMIUM PICTURE.svg …
// Each picture is shown 400 px and 1,200 px wide. No label may overlap another, be cut off by the
// picture's edge, or be smaller than 9 px. Prints what it checked; ends with 1 and the list of
// what is wrong. With SHOTS=FOLDER in the environment it also writes every picture as PNG, in light and dark.

import { readFileSync, writeFileSync } from "node:fs";
import { basename, join } from "node:path";
import { Chromium } from "./chromium.mjs";

const WIDTHS = [400, 1200];
const SMALLEST = 9;

const [program, ...files] = process.argv.slice(2);
const shots = process.env.SHOTS;

/** Runs on the page: what is wrong with the labels of its picture. */
function measure(smallest) {
  const picture = document.querySelector("svg");
  const frame = picture.getBoundingClientRect();
  const labels = [...picture.querySelectorAll("text")].filter((text) => text.textContent.trim()).map((text) => {
    // The height of the letters, without the room that a line of text has above and below, and
    // without the raised dot of a time derivative.
    const { left, right } = text.getBoundingClientRect();
    const { a, d, f } = text.getScreenCTM();
    const first = text.getExtentOfChar(0);
    const inset = 0.16 * first.height;
    const [top, bottom] = [first.y + inset, first.y + first.height - inset].map((y) => d * y + f);
    return { words: text.textContent, left, right, top, bottom, size: a * parseFloat(getComputedStyle(text).fontSize) };
  });
  const problems = [];
  for (const [index, label] of labels.entries()) {
    if (label.size < smallest - 0.01) problems.push(`"${label.words}" is ${label.size.toFixed(1)} px high`);
    if (label.left < frame.left || label.right > frame.right || label.top < frame.top || label.bottom > frame.bottom) problems.push(`"${label.words}" is cut off`);
    for (const other of labels.slice(index + 1)) {
      if (Math.min(label.right, other.right) - Math.max(label.left, other.left) > 0.5 && Math.min(label.bottom, other.bottom) - Math.max(label.top, other.top) > 0.5) problems.push(`"${label.words}" and "${other.words}" overlap`);
    }
  }
  return { count: labels.length, problems };
}

const problems = [];
for (const dark of shots ? [false, true] : [false]) {
  const browser = await Chromium.start(program, { width: 400, height: 400, dark });
  try {
    for (const file of files) {
      const { frameTree } = await browser.send("Page.getFrameTree");
      const html = `<!doctype html><body style="margin:0">${readFileSync(file, "utf8")}`;
      await browser.send("Page.setDocumentContent", { frameId: frameTree.frame.id, html });
      for (const width of WIDTHS) {
        await browser.resize(width, 400);
        await browser.evaluate(`document.querySelector("svg").style.cssText = "display:block;max-width:none;height:auto;width:${width}px"`);
        const found = await browser.evaluate(`(${measure})(${SMALLEST})`);
        for (const problem of found.problems) problems.push(`${file}, ${width} px wide: ${problem}`);
        if (!dark) console.log(`${file}, ${width} px wide: ${found.count} labels`);
        if (shots) {
          const height = Math.ceil(await browser.evaluate(`document.querySelector("svg").getBoundingClientRect().height`));
          await browser.resize(width, height);
          writeFileSync(join(shots, `${basename(file, ".svg")}-${width}-${dark ? "dark" : "light"}.png`), await browser.picture());
        }
      }
    }
  } finally {
    await browser.close();
  }
}
for (const problem of problems) console.log(`wrong: ${problem}`);
process.exitCode = problems.length ? 1 : 0;
