// Plots of angles with their 95 % intervals, events and repetitions. All plots share one stretch of time.
import uPlot from "uplot";

/** Height of a plot, pixels. */
const HEIGHT = 205;
/** Least stretch of time that can be looked at, seconds. */
const SHORTEST = 0.2;
/** Bits of a sample's flags that say that it was not seen. */
const UNSEEN = ["bridged", "not_observable"];

/** Colours of the page, which differ by day and night and in print. */
function colours() {
  const style = getComputedStyle(document.documentElement);
  const of = (name) => style.getPropertyValue(name).trim();
  return { left: of("--left"), right: of("--right"), leftBand: of("--left-band"), rightBand: of("--right-band"),
    text: of("--text"), grid: of("--grid"), repetition: of("--repetition"), event: of("--event"), cursor: of("--accent") };
}

/**
 * Makes the plots in `place`; `load(channels)` reads series. Returns `show(pairs)` and `zoom(how)`.
 */
export function makePlots(place, assessment, clock, load) {
  const start = assessment.start_s ?? 0;
  const whole = [0, clock.duration || 1];
  let range = [...whole];
  let plots = [];
  let turn = 0;

  const repetitions = assessment.performance?.repetitions ?? [];
  const events = assessment.quality.events ?? [];

  function setRange(low, high) {
    let span = Math.min(Math.max(high - low, SHORTEST), whole[1] - whole[0]);
    const from = Math.min(Math.max(low, whole[0]), whole[1] - span);
    range = [from, from + span];
    for (const plot of plots) plot.chart.setScale("x", { min: range[0], max: range[1] });
    tellRange();
  }

  /** What stretch is shown, for assistive technology and for tests. */
  function tellRange() {
    place.dataset.from = range[0].toFixed(3);
    place.dataset.to = range[1].toFixed(3);
    place.setAttribute("aria-label", `Plots from ${range[0].toFixed(1)} to ${range[1].toFixed(1)} seconds`);
  }

  function zoom(how) {
    const [low, high] = range;
    const span = high - low;
    const middle = clock.time >= low && clock.time <= high ? clock.time : (low + high) / 2;
    if (how === "in") setRange(middle - span / 4, middle + span / 4);
    if (how === "out") setRange(middle - span, middle + span);
    if (how === "earlier") setRange(low - span / 2, high - span / 2);
    if (how === "later") setRange(low + span / 2, high + span / 2);
    if (how === "all") setRange(...whole);
  }

  async function show(pairs) {
    const own = ++turn;
    const channels = pairs.flatMap((pair) => pair.channels.map((one) => one.channel));
    const series = channels.length > 0 ? await load(channels) : null;
    // A later choice may have overtaken this one.
    if (own !== turn) return;
    for (const plot of plots) plot.chart.destroy();
    place.replaceChildren();
    plots = pairs.map((pair) => draw(pair, series));
    at(clock.time);
  }

  function draw(pair, series) {
    const colour = colours();
    const time = series.time_s.map((t) => t - start);
    const figure = document.createElement("figure");
    const title = document.createElement("figcaption");
    const readout = document.createElement("span");
    readout.className = "readout";
    title.append(`${pair.title} `, readout);
    figure.append(title);
    place.append(figure);

    const data = [time];
    const lines = [{}];
    const bands = [];
    const parts = pair.channels.map(({ channel, side }) => {
      const one = series.channels.find((candidate) => candidate.channel === channel);
      const name = side === "" ? pair.title : side;
      const main = side === "right" ? colour.right : colour.left;
      const band = side === "right" ? colour.rightBand : colour.leftBand;
      const index = data.length;
      data.push(one.value, one.low, one.high);
      lines.push({ label: name, stroke: main, width: 2, dash: side === "right" ? [7, 4] : undefined, points: { show: false } });
      lines.push({ label: `${name}, low`, stroke: "transparent", width: 0, points: { show: false } });
      lines.push({ label: `${name}, high`, stroke: "transparent", width: 0, points: { show: false } });
      bands.push({ series: [index + 2, index + 1], fill: band });
      return { name, one, side };
    });
    const axis = { stroke: colour.text, grid: { stroke: colour.grid, width: 1 }, ticks: { stroke: colour.grid, width: 1 } };
    const chart = new uPlot({
      width: Math.max(place.clientWidth, 280),
      height: HEIGHT,
      legend: { show: false },
      cursor: { sync: { key: `assessment-${assessment.id}`, scales: ["x", null] }, y: false, drag: { x: true, y: false, setScale: false },
        points: { show: false } },
      scales: { x: { time: false, min: range[0], max: range[1] } },
      series: lines,
      bands,
      axes: [
        { ...axis, values: (_, ticks) => ticks.map((t) => `${+t.toFixed(3)} s`) },
        { ...axis, size: 54, values: (_, ticks) => ticks.map((v) => `${+v.toFixed(3)}${pair.unit === "°" ? "°" : ` ${pair.unit}`}`) },
      ],
      hooks: {
        drawClear: [(chart) => drawRepetitions(chart, colour)],
        draw: [(chart) => drawEvents(chart, colour), (chart) => drawTime(chart, colour)],
        setCursor: [(chart) => tell(chart.cursor.idx, readout, pair, parts, time, series.flag_names)],
        setSelect: [(chart) => {
          if (chart.select.width < 4) return;
          const low = chart.posToVal(chart.select.left, "x");
          const high = chart.posToVal(chart.select.left + chart.select.width, "x");
          chart.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
          setRange(low, high);
        }],
      },
    }, data, figure);
    chart.over.addEventListener("dblclick", () => setRange(...whole));
    chart.over.addEventListener("click", (event) => {
      const { left } = chart.over.getBoundingClientRect();
      clock.stop();
      clock.set(chart.posToVal(event.clientX - left, "x"));
    });
    chart.root.setAttribute("role", "img");
    chart.root.setAttribute("aria-label",
      `${pair.title} over time with 95 % intervals${pair.channels.length > 1 ? ", left and right" : ""}; the table of all series holds its numbers`);
    return { chart, readout, pair, parts, time, flagNames: series.flag_names };
  }

  function drawRepetitions(chart, colour) {
    const { ctx, bbox } = chart;
    ctx.save();
    ctx.fillStyle = colour.repetition;
    for (const repetition of repetitions) {
      const from = Math.max(chart.valToPos(repetition.start_s, "x", true), bbox.left);
      const to = Math.min(chart.valToPos(repetition.end_s, "x", true), bbox.left + bbox.width);
      if (to > from) ctx.fillRect(from, bbox.top, to - from - 1, bbox.height);
    }
    ctx.restore();
  }

  function drawEvents(chart, colour) {
    const { ctx, bbox } = chart;
    ctx.save();
    ctx.fillStyle = colour.event;
    for (const event of events) {
      const from = Math.max(chart.valToPos(event.start_s, "x", true), bbox.left);
      const to = Math.min(chart.valToPos(event.end_s, "x", true), bbox.left + bbox.width);
      if (to >= from) ctx.fillRect(from, bbox.top + bbox.height - 6, Math.max(to - from, 2), 6);
    }
    ctx.restore();
  }

  function drawTime(chart, colour) {
    const { ctx, bbox } = chart;
    const x = chart.valToPos(clock.time, "x", true);
    if (x < bbox.left || x > bbox.left + bbox.width) return;
    ctx.save();
    ctx.strokeStyle = colour.cursor;
    ctx.lineWidth = 2;
    ctx.beginPath();
    ctx.moveTo(x, bbox.top);
    ctx.lineTo(x, bbox.top + bbox.height);
    ctx.stroke();
    ctx.restore();
  }

  /** The readout of a sample: of where the pointer is, or else of the clock's time. */
  function tell(hovered, readout, pair, parts, time, flagNames) {
    const i = hovered ?? nearest(time, clock.time);
    if (i === null) return;
    const unit = pair.unit === "°" ? "°" : ` ${pair.unit}`;
    const number = (value) => (pair.unit === "°" ? value.toFixed(1) : value.toFixed(3));
    const told = parts.map(({ name, side, one }) => {
      const value = one.value[i];
      const label = side === "" ? "" : `${name} `;
      if (value === null || value === undefined) return `${label}no value`;
      const interval = one.low[i] !== null && one.high[i] !== null ? ` (${number(one.low[i])} to ${number(one.high[i])})` : "";
      const unseen = UNSEEN.filter((flag) => one.flags[i] & (1 << flagNames.indexOf(flag)));
      const note = unseen.length > 0 ? `, ${unseen.map((flag) => flag.replaceAll("_", " ")).join(", ")}` : "";
      return `${label}${number(value)}${unit}${interval}${note}`;
    });
    readout.textContent = `at ${time[i].toFixed(2)} s: ${told.join("; ")}`;
  }

  function at(time) {
    if (time < range[0] || time > range[1]) {
      const span = range[1] - range[0];
      setRange(time - span / 10, time + (9 * span) / 10);
    }
    for (const plot of plots) {
      plot.chart.redraw(false, false);
      if (plot.chart.cursor.idx === null || plot.chart.cursor.idx === undefined) {
        tell(null, plot.readout, plot.pair, plot.parts, plot.time, plot.flagNames);
      }
    }
  }

  place.setAttribute("role", "group");
  tellRange();
  clock.listen(at);
  new ResizeObserver(() => {
    for (const plot of plots) plot.chart.setSize({ width: Math.max(place.clientWidth, 280), height: HEIGHT });
  }).observe(place);
  const repaint = () => show(plots.map((plot) => plot.pair));
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", repaint);
  return { show, zoom };
}

/** Place of the sample nearest to a time; null without any. */
export function nearest(times, time) {
  if (times.length === 0) return null;
  let low = 0;
  let high = times.length - 1;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (times[middle] <= time) low = middle;
    else high = middle;
  }
  return time - times[low] <= times[high] - time ? low : high;
}
