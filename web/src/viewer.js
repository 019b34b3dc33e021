// Angles over time and the replay of the skeleton, with one time for both.
import { read } from "./api.js";
import { makePlots } from "./plots.js";
import { pairsOf } from "./channels.js";
import { makeReplay } from "./replay.js";

/** Samples of a series that are asked for: more than a wide screen has columns. */
const MAX_POINTS = 3000;
/** Angles that are shown at first, where the assessment has them; else the first ones. */
const FIRST = ["knee_flexion_deg", "hip_flexion_deg", "trunk_flexion_deg"];
const FIRST_COUNT = 3;

/** Opens every viewer of the page. */
export function openViewers() {
  for (const place of document.querySelectorAll("[data-assessment]")) {
    place.hidden = false;
    open(place).catch((error) => {
      const problem = place.querySelector(".viewer-problem");
      problem.textContent = error.message;
      problem.hidden = false;
    });
  }
}

async function open(place) {
  const address = `/v1/assessments/${encodeURIComponent(place.dataset.assessment)}`;
  const hasJoints = "joints" in place.dataset;
  const [assessment, joints] = await Promise.all([read(address), hasJoints ? read(`${address}/joints`) : null]);
  const duration = Math.max((assessment.end_s ?? 0) - (assessment.start_s ?? 0), joints?.time_s.at(-1) ?? 0);
  const clock = new Clock(place, duration);

  const pairs = pairsOf(assessment.channels);
  const plots = makePlots(place.querySelector(".plots"), assessment, clock, async (channels) => {
    return read(`${address}/series?channels=${channels.join(",")}&max_points=${MAX_POINTS}`);
  });
  const wanted = FIRST.map((name) => pairs.find((pair) => pair.name === name)).filter(Boolean);
  const first = (wanted.length > 0 ? wanted : pairs).slice(0, FIRST_COUNT);
  chooser(place.querySelector(".choose"), pairs, first, plots);
  for (const button of place.querySelectorAll("[data-zoom]")) {
    button.addEventListener("click", () => plots.zoom(button.dataset.zoom));
  }
  const replay = place.querySelector(".replay");
  const hasReplay = joints !== null && joints.time_s.length > 0;
  if (!hasReplay) replay.remove();
  await plots.show(first);
  clock.set(0);
  // When plots could first be used, and the replay: milliseconds since the navigation.
  place.dataset.ready = performance.now().toFixed(0);
  if (!hasReplay) return;
  // The plots are painted before the replay starts its graphics, which may take a while.
  requestAnimationFrame(() => setTimeout(() => {
    makeReplay(replay, joints, clock);
    place.dataset.replayReady = performance.now().toFixed(0);
  }));
}

function chooser(place, pairs, first, plots) {
  const chosen = new Set(first);
  for (const pair of pairs) {
    const label = document.createElement("label");
    const box = document.createElement("input");
    box.type = "checkbox";
    box.checked = chosen.has(pair);
    box.addEventListener("change", () => {
      if (box.checked) chosen.add(pair);
      else chosen.delete(pair);
      plots.show(pairs.filter((one) => chosen.has(one)));
    });
    label.append(box, ` ${pair.title}`);
    place.append(label);
  }
}

/** The time that plots and replay show, with its slider and the button that lets it run. */
class Clock {
  constructor(place, duration) {
    this.duration = duration;
    this.time = 0;
    this.listeners = [];
    this.running = null;
    this.button = place.querySelector(".play");
    this.slider = place.querySelector(".scrub");
    this.output = place.querySelector(".clock");
    this.slider.max = String(duration);
    this.slider.step = String(Math.max(0.01, Math.min(0.1, duration / 500)));
    this.slider.addEventListener("input", () => {
      this.stop();
      this.set(Number(this.slider.value));
    });
    this.button.addEventListener("click", () => (this.running === null ? this.play() : this.stop()));
  }

  /** Calls `listener` with every new time, seconds from the first frame. */
  listen(listener) {
    this.listeners.push(listener);
  }

  set(time) {
    this.time = Math.min(Math.max(time, 0), this.duration);
    this.slider.value = String(this.time);
    const text = `${this.time.toFixed(2)} s`;
    this.slider.setAttribute("aria-valuetext", text);
    this.output.textContent = text;
    for (const listener of this.listeners) listener(this.time);
  }

  play() {
    if (this.time >= this.duration) this.set(0);
    let last = null;
    const step = (now) => {
      if (last !== null) this.set(this.time + (now - last) / 1000);
      last = now;
      if (this.time >= this.duration) this.stop();
      else this.running = requestAnimationFrame(step);
    };
    this.running = requestAnimationFrame(step);
    this.tell(true);
  }

  stop() {
    if (this.running !== null) cancelAnimationFrame(this.running);
    this.running = null;
    this.tell(false);
  }

  tell(running) {
    this.button.textContent = running ? "Pause" : "Play";
  }
}
