"use strict";
// A live run: receives rows and events from the program, and sends commands to it.

/** Rows and events that stay on the page, simulated time that the charts show. */
const KEPT_ROWS = 12000, KEPT_EVENTS = 500, SHOWN_S = 10;

/** Forces of the push buttons along the belt and away from it, N; how long they last, s. */
const PUSHES = [["push ←", [-5, 0]], ["push →", [5, 0]], ["push ↑", [0, 15]]], PUSH_S = 0.05;

function connect(page) {
  const form = $("parameters"), status = $("status");
  const any = document.createElement("label");
  let socket, fresh = false, listed = 0, turn = 0, outdated = 0, offered;
  const send = (order) => { if (socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(order)); };

  for (const only of document.querySelectorAll("[data-live]")) only.hidden = false;
  status.textContent = "connecting …";
  $("verdict").textContent = "live";
  open();

  function open() {
    // The page's own address contains the token.
    socket = new WebSocket(`ws://${location.host}/live${location.search}`);
    socket.binaryType = "arraybuffer";
    let opened = false, told = false;
    socket.addEventListener("open", () => { opened = true; });
    socket.addEventListener("close", ({ reason }) => {
      setPlaying(false);
      // The program answers as long as the run goes on.
      if (!opened) { status.textContent = "the run has ended; the data received stay visible"; return; }
      status.textContent = `${reason || "the connection is lost"}; connecting again …`;
      setTimeout(open, 1000);
    });
    socket.addEventListener("message", ({ data }) => {
      // What was missed would be a gap, or another run.
      if (!told) { told = true; status.textContent = "connected"; clear(); }
      receive(data);
    });
  }

  /** Takes in data at once, whether pictures are drawn or not: a page that is hidden keeps as much as another. */
  function receive(data) {
    if (typeof data !== "string") { page.columns.append(data, KEPT_ROWS); fresh = true; return; }
    const message = JSON.parse(data);
    if (message.event) add(message.event);
    if (message.run) page.describe(message.run);
    if (message.reset) clear();
    // An accepted order has a note, often an empty one, which replaces an earlier error.
    if ("note" in message) show(message.note);
    if ("error" in message) show(message.error, "error");
    if (message.status) {
      const { paused, factor, ticks_per_s, real_time_factor, settings, totals } = message.status;
      offer(settings);
      for (const { key, value } of settings) {
        const input = form.elements[key];
        if (input && input !== document.activeElement) input.value = value ?? "";
      }
      setPlaying(!paused);
      $("speed").value = String(factor);
      status.textContent = paused ? "paused" : `${real_time_factor.toPrecision(3)}× real time, ${Math.round(ticks_per_s)} ticks/s`;
      page.run.totals = totals;
      page.verdict();
    }
  }

  function add(event) {
    page.events.push(event);
    if (page.events.length <= KEPT_EVENTS) return;
    page.events.shift();
    if (listed > 0) { listed -= 1; $("events").querySelector("li").remove(); }
  }

  function show(text, kind = "") { $("message").textContent = text; $("message").className = kind; }

  function clear() {
    page.columns.clear();
    page.events = [];
    page.run.totals = {};
    listed = 0;
    page.listEvents();
    page.verdict();
    page.charts.range = null;
    page.follow = true;
    outdateAll();
  }

  function outdateAll() { outdated = page.charts.plots.length + 1; }

  function setPlaying(playing) { if (page.playing !== playing) page.play(playing); }

  page.toggle = () => send(page.playing ? "pause" : "resume");
  page.speedChanged = (factor) => send({ speed: { factor } });
  const stepBack = page.step.bind(page);
  page.step = (ticks) => {
    if (ticks < 0) { send("pause"); stepBack(ticks); return; }
    page.follow = true;
    send({ step: { ticks } });
  };
  $("reset").addEventListener("click", () => send("reset"));

  /** Called before every picture. */
  page.incoming = () => {
    if (fresh) {
      fresh = false;
      if (page.follow) page.time = page.columns.end;
      page.dirty = true;
      outdateAll();
    }
    if (outdated === 0) return;
    // One chart, or the bands and events, for each picture: all at once would delay it.
    outdated -= 1;
    turn = (turn + 1) % (page.charts.plots.length + 1);
    if (turn > 0) { page.charts.updateOne(turn - 1, SHOWN_S); return; }
    const { start, end } = page.columns, [from, to] = page.charts.range ?? [Math.max(end - SHOWN_S, start), end];
    for (const ribbon of page.ribbons) ribbon.draw(from, to);
    if (page.events.length !== listed) { page.listEvents(listed); listed = page.events.length; page.verdict(); }
  };

  /** Makes a field of each setting before the one for any key; each law has its own settings. */
  function offer(settings) {
    const keys = settings.map(({ key }) => key).join();
    if (keys === offered) return;
    offered = keys;
    while (form.firstChild !== any) form.firstChild.remove();
    for (const { key, label, minimum, maximum, step, template } of settings) {
      const name = document.createElement("label"), input = document.createElement("input");
      Object.assign(input, { type: "number", name: key, min: minimum, max: maximum, step });
      input.addEventListener("change", () => {
        if (input.value !== "") send({ set: { key, value: (template ?? "%").replace("%", Number(input.value).toFixed(9)) } });
      });
      name.append(label, input);
      any.before(name);
    }
  }

  const line = document.createElement("input");
  Object.assign(line, { type: "text", name: "any", placeholder: "run.seed = 2" });
  line.addEventListener("change", () => {
    const [key, ...value] = line.value.split("=");
    if (value.length) send({ set: { key: key.trim(), value: value.join("=").trim() } });
  });
  any.append("any key = value", line);
  form.append(any);
  form.addEventListener("submit", (event) => event.preventDefault());
  for (const [label, force_n] of PUSHES) {
    const button = document.createElement("button");
    Object.assign(button, { type: "button", textContent: label, title: `${Math.hypot(...force_n)} N on the tip for ${1e3 * PUSH_S} ms` });
    button.addEventListener("click", () => send({ push: { force_n, duration_s: PUSH_S } }));
    $("pushes").append(button);
  }
}
