"use strict";
// The arm on its belt at one time, and the bands of modes and states.

class ArmView {
  constructor(canvas, columns) {
    Object.assign(this, { canvas, columns });
    this.resize();
  }

  /** Chooses the scale for an arm. */
  fit(arm) {
    this.arm = arm;
    const reach = arm.link_length_m[0] + arm.link_length_m[1];
    const across = Math.sqrt(Math.max(reach * reach - arm.height_m * arm.height_m, 0.01 * reach * reach));
    this.half = Math.max(1.35 * across, 0.62 * reach);
  }

  resize() {
    const box = this.canvas.getBoundingClientRect(), ratio = window.devicePixelRatio || 1;
    this.canvas.width = Math.max(Math.round(box.width * ratio), 1);
    this.canvas.height = Math.max(Math.round(box.height * ratio), 1);
    this.ratio = ratio;
  }

  /** Colours are read once for each theme: reading them at every frame is slow. */
  theme() {
    this.colours = Object.fromEntries(["ink", "faint", "line", "blue", "orange", "red", "green", "belt", "stripe", "card"]
      .map((name) => [name, ink(`--${name}`)]));
  }

  draw(time) {
    const { columns: c, arm, colours: k, ratio } = this;
    const g = this.canvas.getContext("2d");
    const width = this.canvas.width / ratio, height = this.canvas.height / ratio;
    g.setTransform(ratio, 0, 0, ratio, 0, 0);
    g.clearRect(0, 0, width, height);
    const beltY = height - 46;
    const scale = Math.min(width / (2 * this.half), (beltY - 26) / arm.height_m);
    const x = (t) => width / 2 + t * scale, y = (n) => beltY - n * scale;
    this.belt(g, time, width, scale, x, beltY);
    if (!c.length) return;

    const [l1, l2] = arm.link_length_m;
    const a1 = c.at("theta1_rad", time), a2 = c.at("theta2_rad", time);
    const elbow = [l1 * Math.sin(a1), arm.height_m - l1 * Math.cos(a1)];
    const tip = [elbow[0] + l2 * Math.sin(a2), elbow[1] - l2 * Math.cos(a2)];
    const reference = c.at("reference_m", time);
    if (Number.isFinite(reference)) {
      g.fillStyle = k.orange;
      g.beginPath(); g.moveTo(x(reference), beltY + 3); g.lineTo(x(reference) - 6, beltY + 15); g.lineTo(x(reference) + 6, beltY + 15); g.fill();
    }
    for (const { columns, shift, colour, arm: other } of this.others ?? []) {
      const { height_m, link_length_m: [m1, m2] } = other;
      const at = Math.min(Math.max(time - shift, columns.start), columns.end);
      const [b1, b2] = [columns.at("theta1_rad", at), columns.at("theta2_rad", at)];
      const bend = [m1 * Math.sin(b1), height_m - m1 * Math.cos(b1)];
      g.strokeStyle = ink(colour); g.lineWidth = 3; g.setLineDash([7, 4]);
      g.beginPath(); g.moveTo(x(0), y(height_m)); g.lineTo(x(bend[0]), y(bend[1])); g.lineTo(x(bend[0] + m2 * Math.sin(b2)), y(bend[1] - m2 * Math.cos(b2))); g.stroke();
      g.setLineDash([]);
    }
    // Base.
    g.fillStyle = k.line; g.fillRect(x(0) - 26, y(arm.height_m) - 12, 52, 8);
    g.lineCap = "round"; g.lineJoin = "round";
    g.strokeStyle = k.blue; g.lineWidth = 9;
    g.beginPath(); g.moveTo(x(0), y(arm.height_m)); g.lineTo(x(elbow[0]), y(elbow[1])); g.lineTo(x(tip[0]), y(tip[1])); g.stroke();
    const i = c.index(time);
    for (const [at, radius] of [[[0, arm.height_m], 7], [elbow, 6]]) {
      g.fillStyle = k.card; g.strokeStyle = k.ink; g.lineWidth = 2;
      g.beginPath(); g.arc(x(at[0]), y(at[1]), radius, 0, 7); g.fill(); g.stroke();
    }
    const flies = c.mode[i] === 0;
    g.fillStyle = flies ? k.red : k.ink;
    g.beginPath(); g.arc(x(tip[0]), y(tip[1]), 5, 0, 7); g.fill();
    this.force(g, c.ft_n[i], c.fn_n[i], x(tip[0]), y(tip[1]));
    this.gap(g, c, time, width, flies);
  }

  belt(g, time, width, scale, x, beltY) {
    const { columns: c, colours: k } = this;
    g.fillStyle = k.belt; g.fillRect(0, beltY, width, 14);
    const spacing = 0.06 * scale, travel = (c.length ? c.at("travel_m", time) : 0) * scale;
    g.fillStyle = k.stripe;
    const first = ((x(0) + travel) % spacing + spacing) % spacing;
    for (let at = first - spacing; at < width; at += spacing) g.fillRect(at, beltY + 1, 3, 12);
    if (!c.length) return;
    // Green where the controller allows sliding, red beyond the edges.
    const low = c.at("lower_edge_m", time), high = c.at("upper_edge_m", time);
    if (Number.isFinite(low) && Number.isFinite(high)) {
      const from = Math.max(x(low), 0), to = Math.min(x(high), width);
      g.fillStyle = k.red; g.fillRect(0, beltY - 3, width, 3);
      g.fillStyle = k.green; if (to > from) g.fillRect(from, beltY - 3, to - from, 3);
    }
    const speed = c.belt_m_s[c.index(time)];
    g.fillStyle = k.faint; g.font = "12px system-ui, 'DejaVu Sans', sans-serif"; g.textAlign = "left";
    g.fillText(`belt ${decimals(speed, 2, "m/s")} ${speed < 0 ? "←" : speed > 0 ? "→" : ""}`, 8, beltY + 32);
    g.textAlign = "right"; g.fillText("+t →", width - 8, beltY + 32);
  }

  force(g, tangential, normal, x, y) {
    const size = Math.hypot(tangential, normal);
    if (!(size > 0.05)) return;
    const length = Math.min(6 * size, 110), dx = tangential / size, dy = -normal / size;
    const [ex, ey] = [x + dx * length, y + dy * length];
    g.strokeStyle = g.fillStyle = this.colours.orange; g.lineWidth = 3;
    g.beginPath(); g.moveTo(x, y); g.lineTo(ex - 7 * dx, ey - 7 * dy); g.stroke();
    g.beginPath(); g.moveTo(ex, ey); g.lineTo(ex - 10 * dx - 5 * dy, ey - 10 * dy + 5 * dx); g.lineTo(ex - 10 * dx + 5 * dy, ey - 10 * dy - 5 * dx); g.fill();
  }

  /** The height of the tip over the belt, which is too small to be seen in the drawing. */
  gap(g, c, time, width, flies) {
    const gap = 1e3 * c.at("gap_m", time);
    g.textAlign = "right"; g.font = "600 13px system-ui, 'DejaVu Sans', sans-serif";
    g.fillStyle = flies ? this.colours.red : this.colours.faint;
    g.fillText(flies ? `gap ${fixed(gap, gap < 0.1 ? 3 : 1)} mm` : MODES[c.mode[c.index(time)]][0], width - 10, 20);
  }
}

/** One line of coloured stretches: a column of small numbers over time. */
class Ribbon {
  constructor(parent, label, kinds, kindOf, columns, seek) {
    Object.assign(this, { kinds, kindOf, columns });
    const row = document.createElement("div");
    row.className = "ribbon";
    const name = document.createElement("div");
    name.append(label, this.value = document.createElement("b"));
    this.canvas = document.createElement("canvas");
    this.canvas.setAttribute("role", "img");
    this.canvas.setAttribute("aria-label", `${label} over time: ${kinds.map((kind) => kind[0]).join(", ")}`);
    this.canvas.addEventListener("click", (event) => {
      const box = this.canvas.getBoundingClientRect();
      seek(this.from + (this.to - this.from) * (event.clientX - box.left) / box.width);
    });
    row.append(name, this.canvas);
    parent.append(row);
  }

  draw(from, to) {
    Object.assign(this, { from, to });
    const { canvas, columns: c } = this, ratio = window.devicePixelRatio || 1;
    const width = canvas.width = Math.max(Math.round(canvas.clientWidth * ratio), 1);
    canvas.height = Math.round(canvas.clientHeight * ratio);
    const g = canvas.getContext("2d"), colours = this.kinds.map((kind) => kind[1] && ink(kind[1]));
    if (!c.length || !(to > from)) return;
    const x = (t) => (t - from) / (to - from) * width;
    for (let i = c.index(from), last = c.index(to); i <= last;) {
      const kind = this.kindOf(c, i);
      let j = i + 1;
      while (j <= last && this.kindOf(c, j) === kind) j++;
      const end = j < c.length ? c.t[j] : to;
      if (colours[kind]) {
        g.fillStyle = colours[kind];
        // At least two pixels, so that even the shortest flight is visible.
        g.fillRect(x(c.t[i]), 0, Math.max(x(end) - x(c.t[i]), 2 * ratio), canvas.height);
      }
      i = j;
    }
  }

  now(time) {
    const kind = this.columns.length ? this.kindOf(this.columns, this.columns.index(time)) : 0;
    const text = this.kinds[kind]?.[0] ?? "";
    if (this.value.textContent !== text) this.value.textContent = text;
  }
}
