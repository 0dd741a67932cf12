"use strict";
// Strip charts on one time axis, drawn by uPlot. The playhead is a separate element, so that
// playing does not redraw the curves.

const CHARTS = [
  { title: "Tip along the belt", unit: "mm", least: 0.01, measured: 2, compared: ["tip_m"], curves: [["reference_m", "reference", "--orange", 1e3, false, 5], ["tip_m", "tip", "--ink", 1e3], ["lower_edge_m", "edges", "--red", 1e3, true], ["upper_edge_m", "", "--red", 1e3, true]] },
  { title: "Distance to the edge", unit: "mm", note: "along the belt, to p = 0", curves: [["edge_m", "", "--red", 1e3]], log: [1e-3, 1e3] },
  { title: "p/Q22", unit: "", note: "paradox where p ≤ 0: no curve", curves: [["p_ratio", "", "--green", 1]], log: [1e-4, 10] },
  { title: "Gap", unit: "mm", curves: [["gap_m", "", "--red", 1e3]], zero: true, least: 0.01 },
  { title: "Contact force", unit: "N", curves: [["fn_n", "normal", "--blue", 1], ["ft_n", "tangential", "--orange", 1]], zero: true, most: 60 },
  { title: "Joint torques", unit: "N·m", compared: ["u1_nm", "u2_nm"], curves: [["u1_nm", "u1", "--ink", 1], ["u2_nm", "u2", "--orange", 1]], zero: true },
  { title: "Friction coefficient", unit: "", curves: [["friction", "estimate", "--purple", 1], ["friction_low", "± one deviation", "--purple", 1, true], ["friction_high", "", "--purple", 1, true]], band: [3, 2] },
  { title: "Free normal acceleration b", unit: "m/s²", note: "lift-off where b ≥ 0", curves: [["b_m_s2", "", "--blue", 1]], zero: true },
];

class Charts {
  constructor(parent, columns, seek, zoomed) {
    Object.assign(this, { parent, columns, seek, zoomed, plots: [], range: null, others: [] });
  }

  /** Whether a curve has anything to show. A chart without such a curve is left out. */
  has(name) {
    return [this, ...this.others].some(({ columns }) => {
      const values = columns[name], { length } = columns;
      for (let i = 0; i < length; i++) if (Number.isFinite(values[i]) && values[i] !== 0) return true;
      return false;
    });
  }

  build(all = false) {
    for (const { plot } of this.plots) plot.destroy();
    this.parent.replaceChildren();
    this.plots = this.listed().filter((chart) => all || chart.curves.some(([name]) => this.has(name))).map((chart) => this.chart(chart, all));
    this.update();
  }

  /** The charts. Beside other runs, a chart has only what is compared, and a colour means a run. */
  listed() {
    if (!this.others.length) return CHARTS;
    return CHARTS.map((chart) => {
      const compared = chart.compared ?? [chart.curves[0][0]];
      const curves = chart.curves.filter(([name]) => compared.includes(name));
      const note = curves.length > 1 ? curves.map(([, label]) => label).join(" and ") : chart.note;
      return { ...chart, note, band: undefined, measured: undefined, curves: curves.map(([name, , , scale]) => [name, "", "--ink", scale]) };
    });
  }

  chart(chart, all) {
    const box = document.createElement("div");
    box.className = "chart";
    const title = document.createElement("h2");
    title.textContent = chart.unit ? `${chart.title} (${chart.unit})` : chart.title;
    for (const [column, label, colour, , dashed] of chart.curves) {
      if (!label || !(all || this.has(column))) continue;
      const name = document.createElement("span"), swatch = document.createElement("i");
      swatch.className = "swatch";
      swatch.style.background = `var(${colour})`;
      if (dashed) swatch.style.height = "3px";
      name.append(swatch, label);
      title.append(name);
    }
    if (chart.note) {
      const note = document.createElement("span");
      note.textContent = chart.note;
      title.append(note);
    }
    const holder = document.createElement("div");
    holder.setAttribute("role", "img");
    holder.setAttribute("aria-label", `${title.textContent} over time in seconds`);
    box.append(title, holder);
    this.parent.append(box);
    const axis = { stroke: ink("--faint"), grid: { stroke: ink("--line"), width: 1 }, ticks: { stroke: ink("--line"), width: 1 }, font: "12px system-ui, 'DejaVu Sans', sans-serif" };
    const plot = new uPlot({
      width: Math.max(holder.clientWidth, 200),
      height: 130,
      legend: { show: false },
      cursor: { sync: { key: "run" }, drag: { x: true, y: false, setScale: false }, points: { size: 6 }, bind: { dblclick: () => () => this.zoom(0) } },
      scales: { x: { time: false }, y: chart.log ? { distr: 3, log: 10, range: (_, low, high) => decades(low, high) } : { range: (u, low, high) => span(...(chart.measured ? near(u, chart) : [low, high]), chart) } },
      axes: [{ ...axis, size: 30, values: seconds }, { ...axis, size: 70, space: 20, ...(chart.log ? { splits: (u) => between(u.scales.y), filter: (_, splits) => splits, values: (_, splits) => splits.map(String) } : { values: ticks }) }],
      series: [{}, ...chart.curves.map(([, , colour, , dashed, width]) => ({ stroke: ink(colour), width: width ?? (dashed ? 1 : 1.5), dash: dashed ? [5, 4] : undefined, spanGaps: false, points: { show: false } })), ...this.overlaid(chart).map(({ other }) => ({ stroke: ink(other.colour), width: 1.5, dash: [7, 3], spanGaps: false, points: { show: false } }))],
      bands: chart.band ? [{ series: chart.band, fill: ink("--purple") + "33" }] : [],
      hooks: {
        drawClear: [(u) => this.shadeFlights(u)],
        setSelect: [(u) => this.zoomToSelection(u)],
        init: [(u) => u.over.addEventListener("click", () => { if (u.select.width < 2) this.seek(u.posToVal(u.cursor.left, "x")); })],
      },
    }, this.data(chart), holder);
    const playhead = document.createElement("div");
    playhead.className = "playhead";
    plot.over.append(playhead);
    return { chart, plot, playhead, holder };
  }

  /** The curves of other runs in a chart. */
  overlaid(chart) {
    const compared = chart.compared ?? [chart.curves[0][0]];
    return this.others.flatMap((other) => compared.map((name) => ({ other, name, scale: chart.curves.find((curve) => curve[0] === name)[3] })));
  }

  data(chart) {
    const c = this.columns;
    const curves = chart.curves.map(([name, , , scale]) => (chart.log ? c.positive(name, scale, chart.log) : c.chart(name, scale)));
    return [c.t.subarray(0, c.length), ...curves, ...this.overlaid(chart).map(({ other, name, scale }) => other.columns.resampled(name, c, other.shift, scale, chart.log))];
  }

  /** Draws the present columns. */
  update(window_s = null) {
    for (let number = 0; number < this.plots.length; number++) this.updateOne(number, window_s);
  }

  /** Draws the present columns of one chart. */
  updateOne(number, window_s = null) {
    const { chart, plot } = this.plots[number], { start, end } = this.columns;
    const [from, to] = this.range ?? [window_s ? Math.max(end - window_s, start) : start, end];
    plot.setData(this.data(chart), false);
    plot.setScale("x", { min: from, max: to > from ? to : from + 1 });
  }

  /** Shows the stretch of time that was selected in one chart in all of them. */
  zoomToSelection({ select, posToVal }) {
    if (select.width < 2) return;
    const [min, max] = [select.left, select.left + select.width].map((at) => posToVal(at, "x"));
    this.range = [min, max];
    for (const { plot } of this.plots) {
      plot.setScale("x", { min, max });
      plot.setSelect({ left: 0, width: 0 }, false);
    }
    this.zoomed();
  }

  zoom(factor, centre) {
    const { start, end } = this.columns, [from, to] = this.range ?? [start, end];
    const half = 0.5 * (to - from) * factor;
    this.range = factor === 0 || 2 * half >= end - start ? null : [Math.max(centre - half, start), Math.min(centre + half, end)];
    this.update();
    this.zoomed();
  }

  get shown() { return this.range ?? [this.columns.start, this.columns.end]; }

  shadeFlights(u) {
    const c = this.columns, { left, top, height, width } = u.bbox;
    u.ctx.save();
    u.ctx.fillStyle = ink("--flight");
    u.ctx.beginPath(); u.ctx.rect(left, top, width, height); u.ctx.clip();
    const last = c.index(u.scales.x.max);
    for (let i = c.index(u.scales.x.min); i <= last && i < c.length; i++) {
      if (c.mode[i] !== 0) continue;
      let j = i;
      while (j < last && c.mode[j] === 0) j++;
      const from = u.valToPos(c.t[i], "x", true), to = u.valToPos(c.t[j], "x", true);
      u.ctx.fillRect(from, top, Math.max(to - from, 2), height);
      i = j;
    }
    u.ctx.restore();
  }

  now(time) {
    for (const { plot, playhead } of this.plots) {
      const at = plot.valToPos(time, "x");
      playhead.style.transform = `translateX(${at}px)`;
      playhead.hidden = !(at >= 0 && at <= plot.over.clientWidth);
    }
  }

  resize() {
    for (const { plot, holder } of this.plots) plot.setSize({ width: Math.max(holder.clientWidth, 200), height: 130 });
  }
}

/** The range of the first curves of a chart in the window, with those of the others that are not far from it. */
function near(u, { measured, curves }) {
  const [from, to] = u.series[0].idxs ?? [0, u.data[0].length - 1];
  const range = (numbers) => {
    let low = Infinity, high = -Infinity;
    for (const number of numbers) {
      for (let i = from; i <= to; i++) {
        const value = u.data[number][i];
        if (value != null) { low = Math.min(low, value); high = Math.max(high, value); }
      }
    }
    return [low, high];
  };
  const numbers = u.data.map((_, number) => number).slice(1);
  const first = numbers.filter((number) => number <= measured || number > curves.length);
  let [low, high] = range(first);
  if (!(low <= high)) return [null, null];
  const room = Math.max(high - low, 2);
  for (const number of numbers.filter((number) => !first.includes(number))) {
    const [least, most] = range([number]);
    if (most >= low - room && least <= high + room) { low = Math.min(low, Math.max(least, low - room)); high = Math.max(high, Math.min(most, high + room)); }
  }
  return [low, high];
}

/** Labels of times, the last with its unit. */
function seconds(...axis) {
  const texts = ticks(...axis);
  return texts.map((text, number) => (number === texts.length - 1 ? `${text} s` : text));
}

/** Labels with as many decimals as distinguish them. */
function ticks(_, splits, __, ___, step) {
  let digits = 0;
  while (digits < 9 && Math.abs(step * 10 ** digits - Math.round(step * 10 ** digits)) > 1e-6) digits++;
  return splits.map((value) => (value == null ? "" : fixed(value, digits)));
}

/** The ends of a logarithmic axis. */
function decades(low, high) {
  if (low == null || !(low > 0)) return [0.1, 1];
  return high < 2 * low ? [low / 1.5, high * 1.5] : [low / 1.15, high * 1.15];
}

/** Round places on a logarithmic axis: powers of ten, with 2 and 5 between them if there are few. */
function between({ min, max }) {
  const factors = max / min < 50 ? [1, 2, 5] : [1], places = [];
  for (let power = Math.floor(Math.log10(min)); power <= Math.ceil(Math.log10(max)); power++) {
    for (const factor of factors) {
      const place = Number(`${factor}e${power}`);
      if (place >= min && place <= max) places.push(place);
    }
  }
  return places;
}

/** The range of values of a chart: never empty, with zero where it matters, without spikes beyond `most`. */
function span(low, high, { zero, least = 1e-6, most = Infinity }) {
  if (low == null) return [0, 1];
  if (zero) { low = Math.min(low, 0); high = Math.max(high, 0); }
  low = Math.max(low, -most); high = Math.min(high, most);
  const margin = Math.max(0.06 * (high - low), 0.5 * (least - (high - low)), 1e-9);
  return [low - margin, high + margin];
}
