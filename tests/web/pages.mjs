// Drives the clinician's pages in Chromium: `node pages.mjs '<task as JSON>'`, started by tests/pages/browser.rs. Prints what it
// checks and, as the last line, measurements; ends with 1 when something does not hold.
import { createRequire } from "node:module";
import { readFile, writeFile } from "node:fs/promises";
import path from "node:path";

const require = createRequire(new URL("../../web/package.json", import.meta.url));
const { chromium } = require("playwright-core");
const axeSource = await readFile(require.resolve("axe-core/axe.min.js"), "utf8");

const task = JSON.parse(process.argv[2]);
const url = (address) => `${task.address}${address}`;
const problems = [];
const measured = {};
let checks = 0;

function check(holds, what) {
  checks += 1;
  console.log(`${holds ? "ok  " : "FAIL"} ${what}`);
  if (!holds) problems.push(what);
}

/** Times until a page could be used, milliseconds; generous, since tests share the machine and the build is a debug one. */
const LONGEST_MS = 5000;

const browser = await chromium.launch({ executablePath: task.chromium, headless: true,
  args: ["--no-sandbox", "--enable-unsafe-swiftshader"] });

/** A context in which every request and every complaint of the browser is noted. */
async function open(options = {}) {
  const context = await browser.newContext({ viewport: { width: 1280, height: 900 }, ...options });
  context.on("request", (request) => {
    const address = request.url();
    if (!address.startsWith(task.address) && !address.startsWith("data:")) problems.push(`a request to ${address}`);
  });
  context.on("console", (message) => {
    // The wrong key and the wrong address are asked for on purpose; the last is the software renderer's.
    const asked = ["/app/sign-in", "/app/nothing-here"].some((address) => message.location().url === url(address));
    const expected = asked || message.text().includes("GPU stall");
    if (["error", "warning"].includes(message.type()) && !expected) problems.push(`console: ${message.text()}`);
  });
  context.on("weberror", (error) => problems.push(`script: ${error.error().message}`));
  return context;
}

async function picture(page, name) {
  await page.screenshot({ path: path.join(task.pictures, `${name}.png`), fullPage: true });
}

/** Serious and critical faults by axe. It runs outside of the page's content security policy. */
async function accessible(page, name) {
  const session = await page.context().newCDPSession(page);
  await session.send("Page.enable");
  const { frameTree } = await session.send("Page.getFrameTree");
  const { executionContextId } = await session.send("Page.createIsolatedWorld", { frameId: frameTree.frame.id });
  await session.send("Runtime.evaluate", { expression: axeSource, contextId: executionContextId });
  const { result, exceptionDetails } = await session.send("Runtime.evaluate", { contextId: executionContextId, awaitPromise: true,
    returnByValue: true,
    expression: `axe.run(document).then((found) => found.violations.map((v) => ({ id: v.id, impact: v.impact,
      nodes: v.nodes.slice(0, 5).map((n) => n.html.slice(0, 200) + ' ' + n.failureSummary) })))` });
  if (exceptionDetails) throw new Error(JSON.stringify(exceptionDetails));
  const serious = result.value.filter((one) => ["serious", "critical"].includes(one.impact));
  check(serious.length === 0, `${name}: axe finds no serious fault ${serious.length ? JSON.stringify(serious, null, 1) : ""}`);
  const lesser = result.value.filter((one) => !serious.includes(one)).map((one) => one.id);
  if (lesser.length) console.log(`     lesser: ${lesser.join(", ")}`);
}

async function fits(page, name) {
  const { wide, window } = await page.evaluate(() => ({ wide: document.documentElement.scrollWidth, window: innerWidth }));
  check(wide <= window, `${name}: nothing is wider than the window (${wide} of ${window})`);
}

const ready = (page) => page.waitForSelector("html[data-ready]");
const viewerReady = (page) => page.waitForSelector("[data-assessment][data-ready]", { timeout: 30000 });

try {
  await inLight();
  await withoutScript();
  await onTablet();
  await inDark();
} catch (error) {
  problems.push(String(error.stack));
}
await browser.close();
for (const problem of problems) console.error(problem);
console.log(JSON.stringify({ checks, problems: problems.length, ...measured }));
process.exit(problems.length > 0 ? 1 : 0);

async function signIn(page, next = "/app/patients") {
  await page.goto(url(`/app/sign-in?next=${encodeURIComponent(next)}`));
  await page.fill("#key", task.key);
  await page.press("#key", "Enter");
  await page.waitForURL(url(next));
}

async function inLight() {
  const context = await open({ colorScheme: "light" });
  const page = await context.newPage();

  // Sign-in, by keyboard alone.
  await page.goto(url(`/app/patients/${task.patient}`));
  check(page.url().includes("/app/sign-in"), "a page without a session leads to the sign-in");
  await accessible(page, "sign-in");
  await page.keyboard.press("Tab");
  check(await page.evaluate(() => document.activeElement.className === "skip"), "the first key press offers to skip to the content");
  for (let i = 0; i < 8 && (await page.evaluate(() => document.activeElement.id)) !== "key"; i += 1) await page.keyboard.press("Tab");
  await page.keyboard.type("surefoot_wrong");
  await page.keyboard.press("Enter");
  await page.waitForSelector("[role=alert]");
  check((await page.textContent("[role=alert]")).includes("unknown"), "a wrong key is told");
  await accessible(page, "sign-in with a problem");
  await picture(page, "sign-in");
  await page.fill("#key", task.key);
  await page.press("#key", "Enter");
  await page.waitForURL(url(`/app/patients/${task.patient}`));
  check(true, "the sign-in leads back to the page that was wanted");

  // The list.
  await page.goto(url("/app/patients"));
  await page.focus("#q");
  await page.keyboard.type(task.pseudonym.toLowerCase());
  await page.keyboard.press("Enter");
  await page.waitForURL(/q=/);
  check((await page.locator("tbody tr").count()) === 1, "search finds the one patient whatever the case");
  await accessible(page, "patients");
  await picture(page, "patients");
  await page.focus("tbody a");
  await page.keyboard.press("Enter");
  await page.waitForURL(url(`/app/patients/${task.patient}`));

  // The report.
  await ready(page);
  measured.report_interactive_ms = Number(await page.getAttribute("html", "data-ready"));
  check(measured.report_interactive_ms < LONGEST_MS, `the report can be used after ${measured.report_interactive_ms} ms`);
  await accessible(page, "report");
  await fits(page, "report");
  await picture(page, "report");
  const headings = await page.locator("h2").allTextContents();
  check(headings[0] === "Summary" && headings[1] === "Limit passed", "the summary comes first, then what is beyond its limit");
  const pdf = await page.pdf({ preferCSSPageSize: true, printBackground: true });
  await writeFile(path.join(task.pictures, "report.pdf"), pdf);
  measured.report_pdf_pages = (pdf.toString("latin1").match(/\/Type\s*\/Page\b(?!s)/g) ?? []).length;
  check(measured.report_pdf_pages === 2, `the report prints on ${measured.report_pdf_pages} pages`);

  // An assessment.
  await page.goto(url(`/app/assessments/${task.assessment}`));
  await viewerReady(page);
  measured.assessment_interactive_ms = Number(await page.getAttribute("[data-assessment]", "data-ready"));
  check(measured.assessment_interactive_ms < LONGEST_MS, `plots can be used after ${measured.assessment_interactive_ms} ms`);
  await page.waitForSelector("[data-replay-ready]", { timeout: 30000 });
  measured.replay_interactive_ms = Number(await page.getAttribute("[data-assessment]", "data-replay-ready"));
  check((await page.locator(".plots canvas").count()) === 3, "three plots are drawn at first");
  check((await page.locator(".replay canvas").count()) === 1, "the skeleton is drawn");
  await accessible(page, "assessment");
  await fits(page, "assessment");
  await picture(page, "assessment");
  await viewerByKeyboard(page);
  await viewerByPointer(page);
  const assessmentPdf = await page.pdf({ preferCSSPageSize: true });
  await writeFile(path.join(task.pictures, "assessment.pdf"), assessmentPdf);
  for (const form of ["csv", "mot", "trc", "bvh"]) {
    const answer = await page.evaluate(async (address) => (await fetch(address)).status,
      `/v1/assessments/${task.assessment}/export?form=${form}`);
    check(answer === 200, `the download ${form} is there`);
  }

  // Steps.
  await page.goto(url(`/app/assessments/${task.walk}`));
  await viewerReady(page);
  check((await page.locator("svg.footfalls ellipse").count()) >= 2, "the footfall map has prints");
  check((await page.textContent("figcaption:has(code)")).includes("definition"), "the map names its definition");
  await accessible(page, "assessment of a walk");
  await picture(page, "walk");

  // Work as it goes on.
  await page.goto(url(`/app/sessions/${task.live}`));
  await ready(page);
  check((await page.textContent(".job")).startsWith("queued"), "a job that waits says so");
  await accessible(page, "session");
  await writeFile(task.go, "");
  await page.waitForSelector(".job.done", { timeout: 120000 });
  await page.waitForSelector("text=Open the assessment");
  check((await page.textContent(".job")) === "done", "its end shows without a reload, and a way to the result");
  await picture(page, "session");

  await page.goto(url("/app/nothing-here"));
  await accessible(page, "not found");
  await page.click("text=List of patients");
  await page.click("text=Sign out");
  await page.waitForURL(url("/app/sign-in"));
  await page.goto(url("/app/patients"));
  check(page.url().includes("/app/sign-in"), "after the sign-out the pages are closed");
  await context.close();
}

async function clockOf(page) {
  return Number((await page.textContent(".clock")).replace(" s", ""));
}

function rangeOf(page) {
  return page.evaluate(() => ["from", "to"].map((end) => Number(document.querySelector(".plots").dataset[end])));
}

async function viewerByKeyboard(page) {
  await page.focus(".scrub");
  for (let i = 0; i < 60; i += 1) await page.keyboard.press("ArrowRight");
  const time = await clockOf(page);
  check(time > 1, `the time slider takes the arrow keys (${time} s)`);
  const shown = Number(await page.getAttribute(".replay canvas", "data-time"));
  check(Math.abs(shown - time) < 0.06, `the replay is in step with the slider (${shown} s)`);
  const readout = await page.textContent(".readout >> nth=0");
  check(/at \d/.test(readout) && readout.includes("left") && readout.includes("right") && readout.includes("to"),
    `values with intervals of both sides are read out: ${readout}`);
  const before = await rangeOf(page);
  await page.focus("[data-zoom=in]");
  await page.keyboard.press("Enter");
  const after = await rangeOf(page);
  check(after[1] - after[0] < 0.6 * (before[1] - before[0]) && after[0] <= time && after[1] >= time, "Zoom in halves the stretch around the time");
  await page.focus("[data-zoom=all]");
  await page.keyboard.press("Space");
  check(String(await rangeOf(page)) === String(before), "Whole recording shows all of it again");
  await page.focus(".play");
  await page.keyboard.press("Space");
  await page.waitForTimeout(400);
  await page.keyboard.press("Space");
  const played = await clockOf(page);
  check(played > time && played < time + 5, `Play and Pause work by key (${played} s)`);
  await page.waitForTimeout(200);
  check((await clockOf(page)) === played, "a paused replay stands still");
  const pixels = () => page.locator(".replay canvas").screenshot();
  const front = await pixels();
  await page.focus(".replay canvas");
  for (let i = 0; i < 5; i += 1) await page.keyboard.press("ArrowRight");
  check(!front.equals(await pixels()), "arrow keys turn the skeleton");
}

async function viewerByPointer(page) {
  const over = page.locator(".u-over").first();
  await over.scrollIntoViewIfNeeded();
  const box = await over.boundingBox();
  const at = (share) => [box.x + share * box.width, box.y + box.height / 2];
  await page.mouse.move(...at(0.5));
  const hovered = await page.textContent(".readout >> nth=0");
  const [low, high] = await rangeOf(page);
  const time = Number(/at ([\d.]+)/.exec(hovered)[1]);
  check(Math.abs(time - (low + high) / 2) < 0.2, `hovering reads out that time (${hovered})`);
  const second = await page.textContent(".readout >> nth=1");
  check(Number(/at ([\d.]+)/.exec(second)[1]) === time, "and the other plots do so too");
  await page.mouse.move(...at(0.25));
  await page.mouse.down();
  await page.mouse.move(...at(0.4));
  await page.mouse.move(...at(0.5));
  await page.mouse.up();
  const zoomed = await rangeOf(page);
  check(Math.abs(zoomed[1] - zoomed[0] - (high - low) / 4) < 0.1 * (high - low), `dragging zooms (${zoomed})`);
  await picture(page, "assessment-zoomed");
  await over.dblclick();
  check(String(await rangeOf(page)) === String([low, high]), "a double click shows all again");
  await page.locator(".choose input").first().click();
  await page.waitForFunction(() => document.querySelectorAll(".plots canvas").length !== 3);
  check([2, 4].includes(await page.locator(".plots canvas").count()), "an angle can be chosen or left out");
}

async function withoutScript() {
  const context = await open({ javaScriptEnabled: false });
  const page = await context.newPage();
  await signIn(page);
  await page.goto(url(`/app/patients/${task.patient}`));
  check((await page.locator("svg.sparkline").count()) >= 3, "without a script the report has its trends");
  await page.goto(url(`/app/assessments/${task.assessment}`));
  check((await page.textContent("body")).includes("Right knee flexion"), "without a script an assessment has its numbers");
  await context.close();
}

async function onTablet() {
  const context = await open({ viewport: { width: 820, height: 1180 }, hasTouch: true, deviceScaleFactor: 1 });
  const page = await context.newPage();
  await signIn(page);
  for (const [name, address] of [["report", `/app/patients/${task.patient}`], ["assessment", `/app/assessments/${task.assessment}`],
    ["walk", `/app/assessments/${task.walk}`], ["patients", "/app/patients"]]) {
    await page.goto(url(address));
    await (address.includes("assessments") ? viewerReady(page) : ready(page));
    if (name === "assessment") await page.waitForSelector("[data-replay-ready]", { timeout: 30000 });
    await fits(page, `tablet, ${name}`);
    await picture(page, `tablet-${name}`);
  }
  await page.setViewportSize({ width: 390, height: 844 });
  await page.goto(url(`/app/patients/${task.patient}`));
  await fits(page, "telephone, report");
  await context.close();
}

async function inDark() {
  const context = await open({ colorScheme: "dark" });
  const page = await context.newPage();
  await signIn(page);
  for (const [name, address] of [["report", `/app/patients/${task.patient}`], ["assessment", `/app/assessments/${task.assessment}`],
    ["walk", `/app/assessments/${task.walk}`]]) {
    await page.goto(url(address));
    await (address.includes("assessments") ? viewerReady(page) : ready(page));
    if (name === "assessment") await page.waitForSelector("[data-replay-ready]", { timeout: 30000 });
    await accessible(page, `dark, ${name}`);
    await picture(page, `dark-${name}`);
  }
  await context.close();
}
