"use strict";
// The page of a run: reads the run from the page or from the program, plays it and handles its controls.

const $ = (id) => document.getElementById(id);

class Page {
  constructor(run) {
    this.run = run;
    this.columns = new Columns(run.columns, run.byte_columns);
    this.events = [];
    this.live = run.rows === undefined;
    this.playing = false;
    this.time = 0;
    this.follow = true;
    if (!this.live) {
      this.columns.append(bytesOfBase64(run.rows));
      this.events = run.events;
    }
    this.time = this.columns.start;
    this.arm = new ArmView($("arm"), this.columns);
    this.describe(run);
    this.verdict();
    const seek = (time) => this.seek(time);
    const bit = (flag) => (c, i) => (c.flags[i] & flag ? 1 : 0);
    const flag = (name, colour, mask) => [name, [["", ""], ["yes", colour]], bit(mask)];
    this.ribbons = [
      ["contact", MODES, (c, i) => c.mode[i]],
      ["controller", STATES, (c, i) => c.state[i]],
      ["fault", [["none", ""], ["latched", "--purple"]], (c, i) => (c.fault[i] ? 1 : 0)],
      flag("at edge", "--red", FLAGS.edge),
      flag("recovering", "--orange", FLAGS.recovering),
    ].map(([label, kinds, kindOf]) => new Ribbon($("ribbons"), label, kinds, kindOf, this.columns, seek));
    this.charts = new Charts($("charts"), this.columns, seek, () => this.zoomed());
    this.compare(run.comparison);
    this.controls();
    this.theme(window.matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light");
    this.listEvents();
    new ResizeObserver(() => { this.arm.resize(); this.charts.resize(); this.drawRibbons(); this.dirty = true; }).observe($("stage"));
    requestAnimationFrame((now) => this.frame(now));
  }

  /** Shows what runs; a live run sends it again when it has changed. */
  describe(run) {
    this.run = { ...this.run, ...run };
    this.arm.fit(run.arm);
    this.dirty = true;
    document.title = `${run.name} · painleve`;
    $("title").textContent = run.name;
    $("subtitle").textContent = `${run.description ? `${run.description.replace(/\.?$/, ".")} ` : ""}Law ${run.law} · ${run.tick_hz} Hz · μ = ${run.friction} · seed ${run.seed}`;
    $("settings").querySelector("pre").textContent = run.settings;
    for (const [id, text, type] of [["save", run.settings, "toml"], ["save-changes", run.changes ?? "", "sh"]]) {
      $(id).href = `data:text/plain;charset=utf-8,${encodeURIComponent(text)}`;
      $(id).download = `${run.name}.${type}`;
    }
  }

  /** Says what has happened, also where an event is not listed. */
  verdict() {
    const totals = this.run.totals ?? {}, { "lift-off": [lifts, first] = [0], fault: [, fault] = [] } = totals;
    const texts = [lifts ? `${lifts} lift-off${lifts > 1 ? "s" : ""}, first at ${first[0].toFixed(3)} s` : "no lift-off"];
    if (fault) texts.push(fault[2]);
    $("verdict").textContent = texts.join(" · ");
    $("verdict").dataset.good = String(!lifts && !fault);
    const listed = this.events.length, count = Object.values(totals).reduce((sum, [number]) => sum + number, 0);
    $("events").querySelector("summary").textContent = `Events (${count > listed ? `${count}, the ${this.live ? "last" : "first"} ${listed} listed` : listed})`;
  }

  /** Shows other runs beside this one. */
  compare(comparison) {
    if (!comparison) { for (const only of document.querySelectorAll("[data-compare]")) only.remove(); return; }
    const colours = ["--orange", "--blue", "--green", "--purple", "--sky", "--red"];
    const others = comparison.others.map(({ label, shift_s, rows, arm }, number) => {
      const columns = new Columns(this.run.columns, this.run.byte_columns);
      columns.append(bytesOfBase64(rows));
      return { label, shift: shift_s, columns, arm, colour: colours[number % colours.length] };
    });
    this.arm.others = this.charts.others = others;
    document.title = `${[comparison.label, ...others.map(({ label }) => label)].join(" · ")} · painleve`;
    $("title").textContent = "Comparison of runs";
    $("subtitle").textContent = comparison.aligned;
    $("verdict").textContent = "";
    for (const { label, colour } of [{ label: comparison.label, colour: "--ink" }, ...others]) {
      const name = document.createElement("span"), swatch = document.createElement("i");
      swatch.className = "swatch";
      swatch.style.background = `var(${colour})`;
      name.append(swatch, label);
      $("runs").append(name);
    }
    for (const { title, head, rows } of comparison.tables) {
      const table = $("comparison").appendChild(document.createElement("table"));
      table.createCaption().textContent = title;
      const isText = head.map((_, column) => rows.some((cells) => /[a-z]/.test(cells[column])));
      const fill = (row, kind, cells) => cells.forEach((text, column) => {
        const cell = row.appendChild(document.createElement(kind));
        cell.textContent = text;
        cell.classList.toggle("text", isText[column]);
      });
      fill(table.createTHead().insertRow(), "th", head);
      const body = table.createTBody();
      for (const cells of rows) fill(body.insertRow(), "td", cells);
    }
  }

  /** After a zoom: the time goes into the window. */
  zoomed() {
    const [from, to] = this.charts.shown;
    if (!this.live && (this.time < from || this.time > to)) this.seek(from);
    this.drawRibbons();
    this.dirty = true;
  }

  controls() {
    const on = (id, act) => $(id).addEventListener("click", act);
    on("play", () => this.toggle());
    on("start", () => this.seek(this.columns.start));
    on("back", () => this.step(-1));
    on("forward", () => this.step(1));
    on("theme", () => this.theme(document.documentElement.dataset.theme === "dark" ? "light" : "dark"));
    $("scrub").addEventListener("input", () => this.seek(Number($("scrub").value)));
    $("speed").addEventListener("change", () => this.speedChanged?.(Number($("speed").value)));
    if (!this.live) for (const only of document.querySelectorAll("[data-live]")) only.remove();
    document.addEventListener("keydown", (event) => {
      const taken = `input:not([type=range]), select, textarea${event.key === " " ? ", summary" : ""}`;
      if (event.target.matches(taken) || event.ctrlKey || event.metaKey || event.altKey) return;
      const far = event.shiftKey ? 0.1 : 0;
      const act = {
        " ": () => this.toggle(), ArrowLeft: () => (far ? this.seek(this.time - far) : this.step(-1)),
        ArrowRight: () => (far ? this.seek(this.time + far) : this.step(1)),
        Home: () => this.seek(this.columns.start), End: () => this.seek(this.columns.end),
        "+": () => this.charts.zoom(0.5, this.time), "=": () => this.charts.zoom(0.5, this.time),
        "-": () => this.charts.zoom(2, this.time), 0: () => this.charts.zoom(0, this.time),
      }[event.key];
      if (act) { event.preventDefault(); if (event.target.tagName === "BUTTON") event.target.blur(); act(); }
    });
  }

  theme(name) {
    document.documentElement.dataset.theme = name;
    this.arm.theme();
    this.charts.build(this.live);
    this.drawRibbons();
    this.dirty = true;
  }

  get speed() { return Number($("speed").value); }

  toggle() { this.play(!this.playing); }

  play(playing) {
    if (playing && !this.live && this.time >= this.columns.end) this.time = this.columns.start;
    this.playing = playing;
    $("play").textContent = playing ? "❚❚" : "▶";
    $("play").setAttribute("aria-label", playing ? "Pause" : "Play");
    this.last = undefined;
    this.dirty = true;
  }

  step(rows) {
    const c = this.columns;
    if (this.playing) this.play(false);
    this.seek(c.t[Math.min(Math.max(c.index(this.time + 1e-9) + rows, 0), c.length - 1)] ?? 0);
  }

  seek(time) {
    const c = this.columns;
    this.time = Math.min(Math.max(time, c.start), c.end);
    this.follow = this.time >= c.end;
    this.dirty = true;
  }

  /** Draws one picture; called by the browser before each of its own. */
  frame(now) {
    if (this.playing && !this.live) {
      const elapsed = this.last === undefined ? 0 : (now - this.last) / 1000;
      this.last = now;
      this.time += elapsed * this.speed;
      if (this.time >= this.columns.end) { this.time = this.columns.end; this.play(false); }
      this.dirty = true;
    }
    this.incoming?.(now);
    if (this.dirty) { this.dirty = false; this.draw(); }
    requestAnimationFrame((next) => this.frame(next));
  }

  draw() {
    const c = this.columns, time = this.time;
    this.arm.draw(time);
    this.charts.now(time);
    for (const ribbon of this.ribbons) ribbon.now(time);
    const scrub = $("scrub");
    scrub.min = c.start; scrub.max = c.end; scrub.value = time;
    $("time").textContent = `${time.toFixed(3)} s`;
    this.readout(time);
    this.markEvent(time);
  }

  readout(time) {
    const c = this.columns;
    if (!c.length) return;
    const i = c.index(time), show = (name, digits, unit, scale = 1) => decimals(c[name][i] * scale, digits, unit);
    const edge = c.p_ratio[i] <= 0 ? "inside" : show("edge_m", 2, "mm", 1e3);
    const cells = [
      ["tip", show("tip_m", 2, "mm", 1e3)], ["reference", show("reference_m", 2, "mm", 1e3)],
      ["gap", show("gap_m", 4, "mm", 1e3)], ["belt", show("belt_m_s", 3, "m/s")],
      ["normal force", show("fn_n", 2, "N")], ["tangential force", show("ft_n", 2, "N")],
      ["u1", show("u1_nm", 3, "N·m")], ["u2", show("u2_nm", 3, "N·m")],
      ["b", show("b_m_s2", 2, "m/s²")], ["p", show("p_per_kg", 3, "1/kg")],
      ["to the edge", edge], ["p/Q22", show("p_ratio", 3, "")],
      ["μ estimate", `${decimals(c.friction[i], 3, "")}± ${decimals(c.friction_deviation[i], 3, "")}`], ["contact confidence", show("confidence", 3, "")],
    ];
    const body = $("readout").tBodies[0];
    if (!body.rows.length) {
      for (let k = 0; k < cells.length; k += 2) {
        const row = body.insertRow();
        for (const [label] of cells.slice(k, k + 2)) { row.insertCell().textContent = label; row.insertCell(); }
      }
    }
    cells.forEach(([, text], k) => {
      const cell = body.rows[k >> 1].cells[2 * (k % 2) + 1];
      if (cell.textContent !== text) cell.textContent = text;
    });
  }

  drawRibbons() {
    const [from, to] = this.charts.shown;
    for (const ribbon of this.ribbons) ribbon.draw(from, to);
  }

  listEvents(from = 0) {
    const list = $("events").querySelector("ol");
    if (from === 0) list.replaceChildren();
    for (const [time, , text] of this.events.slice(from)) {
      const item = document.createElement("li"), button = document.createElement("button");
      button.type = "button";
      button.textContent = `${time.toFixed(4)} s  ${text}`;
      button.addEventListener("click", () => { if (!this.live) this.play(false); this.seek(time); });
      item.append(button);
      list.append(item);
    }
    this.current = null;
  }

  /** Marks the last event before a time. */
  markEvent(time) {
    let low = -1, high = this.events.length - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (this.events[middle][0] <= time) low = middle; else high = middle - 1;
    }
    const current = low < 0 ? null : $("events").querySelector("ol").children[low]?.firstChild;
    if (current === this.current) return;
    this.current?.classList.remove("current");
    current?.classList.add("current");
    this.current = current;
    const list = current?.closest("ol");
    if (list) list.scrollTop = current.offsetTop - list.offsetTop - 60;
  }
}

const page = new Page(JSON.parse($("run").textContent));
if (page.live) connect(page);
