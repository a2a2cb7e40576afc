"use strict";
/* Draws the figures of a report: unpacks the numbers (gearfmu/report/packed.py), draws each panel with Plotly when it
   comes near the window, zooms panels of one group together, and thins long curves to what the width can show. What is
   in the window comes first: Plotly is unpacked and run once the first picture stands, or at once where a figure is
   seen. The document's element is of class `ready` when all that is in the window is drawn. */
(() => {
  const LEFT = 58, RIGHT = 12, PALETTE = 8, THIN_FROM = 3000;
  const root = document.documentElement;
  const colour = name => getComputedStyle(root).getPropertyValue(name).trim();
  const page = (window.gearfmuPage = { drawn: 0, errors: [] });
  let content, arrays, cache = [], panels = new Map(), linked = false;

  function bytesOf(id) {
    const text = atob(document.getElementById(id).textContent), found = new Uint8Array(text.length);
    for (let i = 0; i < text.length; i++) found[i] = text.charCodeAt(i);
    return found;
  }

  async function inflated(id) {
    const stream = new Blob([bytesOf(id)]).stream().pipeThrough(new DecompressionStream("gzip"));
    return new Response(stream).arrayBuffer();
  }

  async function unpack() {
    const buffer = await inflated("numbers"), length = new DataView(buffer).getUint32(0, true);
    content = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
    arrays = { heads: content.arrays, buffer, base: 4 + length };
  }

  const SCALES = Object.fromEntries(Object.entries({
    magma: ["#000004", "#1c1044", "#4f127b", "#812581", "#b5367a", "#e55964", "#fb8761", "#fec287", "#fcfdbf"],
    steel: ["#d6dce3", "#a3bfd8", "#4f88b8", "#e2a63e", "#bb3a26"],
  }).map(([name, list]) => [name, list.map((tone, k) => [k / (list.length - 1), tone])]));
  const RAW = { i1: Int8Array, u2: Uint16Array, i4: Int32Array, f4: Float32Array, f8: Float64Array };

  function array(number) {
    if (cache[number]) return cache[number];
    const head = arrays.heads[number], n = head.n, at = arrays.base + (head.at || 0);
    if (RAW[head.kind]) {
      const width = RAW[head.kind].BYTES_PER_ELEMENT;
      const part = at % width ? arrays.buffer.slice(at, at + n * width) : null;
      return (cache[number] = part ? new RAW[head.kind](part) : new RAW[head.kind](arrays.buffer, at, n));
    }
    const found = new Float64Array(n);
    if (head.kind === "even") for (let i = 0; i < n; i++) found[i] = head.start + i * head.step;
    else {
      const raw = new Uint8Array(arrays.buffer, at), span = head.high - head.low;
      if (head.kind === "u1") for (let i = 0; i < n; i++) found[i] = raw[i] === 255 ? NaN : head.low + raw[i] / 254 * span;
      else for (let i = 0, step = 0; i < n; i++) {
        step = (step + raw[i] + 256 * raw[n + i]) & 65535;
        found[i] = step === 65535 ? NaN : head.low + step / 65534 * span;
      }
    }
    return (cache[number] = found);
  }
  page.array = array;
  page.colour = colour;

  /* lowest and highest value of every column of the window between x = from and to */
  function thinned(curve, from, to, columns) {
    const x = array(curve.x), y = array(curve.y);
    if (!curve.ascending || x.length <= THIN_FROM || curve.look === "bars") return [x, y];
    const place = value => {
      let a = 0, b = x.length;
      while (a < b) { const m = (a + b) >> 1; if (x[m] < value) a = m + 1; else b = m; }
      return a;
    };
    const first = Math.max(0, place(from) - 1), last = Math.min(x.length, place(to) + 2), width = (last - first) / columns;
    if (width <= 2) return [x.slice(first, last), y.slice(first, last)];
    const xs = [], ys = [];
    for (let k = 0; k < columns; k++) {
      const a = first + Math.floor(k * width), b = first + Math.floor((k + 1) * width);
      let low = a, high = a;
      for (let i = a + 1; i < b; i++) { if (y[i] < y[low] || y[low] !== y[low]) low = i; if (y[i] > y[high] || y[high] !== y[high]) high = i; }
      for (const i of low < high ? [low, high] : [high, low]) { xs.push(x[i]); ys.push(y[i]); }
    }
    return [xs, ys];
  }

  function extent(panel) {
    if (panel.xLimits) return panel.xLimits;
    let low = Infinity, high = -Infinity;
    for (const curve of panel.curves) {
      const x = array(curve.x);
      for (const i of curve.ascending ? [0, x.length - 1] : x.keys()) { low = Math.min(low, x[i]); high = Math.max(high, x[i]); }
    }
    if (panel.heat) { const x = array(panel.heat.x); low = Math.min(low, x[0], x[x.length - 1]); high = Math.max(high, x[0], x[x.length - 1]); }
    if (panel.curves.some(curve => curve.look === "bars")) { low -= 0.5; high += 0.5; }
    return low < high ? [low, high] : [low - 1, high + 1];
  }

  function traceOf(panel, curve, range, columns) {
    const [x, y] = thinned(curve, range[0], range[1], columns), line = colour(`--c${curve.colour}`);
    const hover = `${curve.name}: %{y:.5~g} ${curve.unit}<extra></extra>`;
    if (curve.look === "bars") return { type: "bar", x: panel.ticks || x, y, name: curve.name, marker: { color: line }, hovertemplate: hover };
    const dash = { dashed: "dash", dotted: "dot" }[curve.look] || "solid", over = panel.heat ? 0.8 : 1.3;
    return { type: "scatter", mode: curve.look === "points" ? "markers" : "lines", x, y, name: curve.name, hovertemplate: hover,
      marker: { color: line, size: 5 }, hoverinfo: panel.heat ? "skip" : undefined,
      line: { color: panel.heat ? "rgba(255,255,255,.75)" : line, width: over, dash, simplify: false } };
  }

  function tracesOf(panel, range, columns) {
    const found = panel.curves.map(curve => traceOf(panel, curve, range, columns));
    if (panel.heat) {
      const heat = panel.heat, x = array(heat.x), y = array(heat.y), flat = array(heat.z), z = [];
      for (let row = 0; row < y.length; row++) z.push(flat.subarray(row * x.length, (row + 1) * x.length));
      found.unshift({ type: "heatmap", x, y, z, zmin: heat.low, zmax: heat.high, colorscale: SCALES[heat.scale], zsmooth: false,
        hovertemplate: `%{x:.4~g}, %{y:.4~g}: %{z:.1f} ${heat.unit}<extra></extra>`,
        colorbar: { thickness: 10, outlinewidth: 0, tickfont: { size: 11 }, title: { text: heat.unit, side: "right", font: { size: 11 } } } });
    }
    if (panel.dots) found.push({ type: "scatter", mode: "markers", x: array(panel.dots[0]), y: array(panel.dots[1]),
      marker: { symbol: "circle-open", size: 9, color: "#fff", line: { width: 1.3 } }, hovertemplate: "%{x:.5~g}, %{y:.5~g}<extra>resonance</extra>" });
    return found;
  }

  function shapesOf(panel) {
    const found = panel.spans.map(([x0, x1, kind]) => ({ type: "rect", xref: "x", yref: "paper", x0, x1, y0: 0, y1: 1,
      fillcolor: colour(`--${kind}`), line: { width: 0 }, layer: "below" }));
    for (const mark of panel.marks) {
      const tick = mark.look === "tick", side = mark.look === "side";
      found.push({ type: "line", xref: "x", yref: "paper", x0: mark.x, x1: mark.x, y0: tick ? 0.94 : 0, y1: 1, layer: tick || panel.heat ? "above" : "below",
        line: { color: mark.colour === null ? colour("--muted") : colour(`--c${mark.colour % PALETTE}`), width: tick ? 1.6 : side ? 0.5 : 0.9, dash: tick || side ? "solid" : "dot" },
        opacity: side ? 0.35 : 1 });
    }
    return found;
  }

  function layoutOf(panel, range) {
    const axis = { gridcolor: colour("--line"), zeroline: false, linecolor: colour("--muted"), tickcolor: colour("--muted"), ticks: "outside",
      ticklen: 4, automargin: false, tickfont: { size: 11 }, exponentformat: "power", minexponent: 4 };
    const touch = matchMedia("(pointer: coarse)").matches;
    const text = panel.marks.filter(mark => mark.text).map(mark => ({ x: mark.x, y: 1, xref: "x", yref: "paper", text: mark.text, showarrow: false,
      xanchor: "left", yanchor: "top", font: { size: 10, color: colour("--muted") } }));
    return { margin: { l: LEFT, r: panel.heat ? 4 : RIGHT, t: touch ? 24 : 4, b: panel.x ? 34 : 20 }, modebar: { bgcolor: "rgba(0,0,0,0)", color: colour("--muted"), activecolor: colour("--ink") }, paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)",
      font: { family: getComputedStyle(document.body).fontFamily, size: 11.5, color: colour("--ink") }, showlegend: false,
      hovermode: panel.heat ? "closest" : "x unified", hoverlabel: { bgcolor: colour("--card"), bordercolor: colour("--line"), font: { size: 11.5, color: colour("--ink") }, align: "left", namelength: -1 },
      xaxis: { ...axis, range: range.slice(), title: { text: panel.x, font: { size: 11.5 }, standoff: 4 }, showgrid: !panel.heat, hoverformat: ".6~g",
        type: panel.ticks ? "category" : undefined, dtick: !panel.ticks && panel.curves.some(curve => curve.look === "bars") ? 1 : undefined, spikemode: "across", spikethickness: 1, spikecolor: colour("--muted"), spikedash: "solid" },
      yaxis: { ...axis, range: panel.yLimits ? panel.yLimits.slice() : undefined, showgrid: !panel.heat, nticks: 6 },
      shapes: shapesOf(panel), annotations: text, dragmode: touch ? false : "zoom", bargap: 0.35, uirevision: 1 };
  }

  const CONFIG = { responsive: true, displaylogo: false, doubleClick: "reset", toImageButtonOptions: { format: "svg" },
    displayModeBar: matchMedia("(pointer: coarse)").matches ? true : "hover",
    modeBarButtons: [["zoomIn2d", "zoomOut2d", "pan2d", "zoom2d", "resetScale2d", "toImage"]] };

  function columnsOf(place) { return Math.max(200, Math.min(1600, place.clientWidth - LEFT)); }

  function draw(place) {
    const own = panels.get(place.id);
    if (!own || own.drawn) return;
    own.drawn = true;
    own.full = extent(own.panel);
    const range = own.panel.group && content.zoom && content.zoom[own.panel.group] || own.full;
    Plotly.newPlot(place, tracesOf(own.panel, range, columnsOf(place)), layoutOf(own.panel, range), CONFIG);
    place.on("plotly_relayout", change => zoomed(place, own, change));
    place.on("plotly_hover", event => together(place, own, event));
    place.on("plotly_unhover", () => alone(place, own));
    page.drawn++;
  }

  function zoomed(place, own, change) {
    if (!Object.keys(change).some(key => key.startsWith("xaxis"))) return;
    const range = place.layout.xaxis.range.map(Number);
    own.panel.curves.forEach((curve, k) => {
      if (!curve.ascending || array(curve.x).length <= THIN_FROM) return;
      const [x, y] = thinned(curve, range[0], range[1], columnsOf(place));
      Plotly.restyle(place, { x: [x], y: [y] }, [k + (own.panel.heat ? 1 : 0)]);
    });
    if (linked || !own.panel.group) return;
    linked = true;
    content.zoom = { ...content.zoom, [own.panel.group]: range };
    const others = [...panels.values()].filter(other => other !== own && other.drawn && other.panel.group === own.panel.group);
    Promise.all(others.map(other => Plotly.relayout(other.place, { "xaxis.range": range.slice() }))).finally(() => { linked = false; });
  }

  /* the same time is pointed at in all panels of a figure */
  function together(place, own, event) {
    if (linked || own.panel.heat || !event.xvals) return;
    linked = true;
    for (const other of own.beside()) if (other.drawn && !other.panel.heat) Plotly.Fx.hover(other.place, { xval: event.xvals[0] });
    linked = false;
  }
  function alone(place, own) {
    if (linked) return;
    linked = true;
    for (const other of own.beside()) if (other.drawn) Plotly.Fx.unhover(other.place);
    linked = false;
  }

  function keys(own) {
    own.place.parentElement.querySelectorAll("button.key").forEach(key => {
      key.setAttribute("aria-pressed", "true");
      key.addEventListener("click", async () => {
        await plotly();
        draw(own.place);
        const on = key.getAttribute("aria-pressed") !== "true";
        key.setAttribute("aria-pressed", String(on));
        Plotly.restyle(own.place, { visible: on }, [Number(key.dataset.curve) + (own.panel.heat ? 1 : 0)]);
      });
    });
  }

  function redraw() {
    for (const own of panels.values()) if (own.drawn) {
      const range = own.place.layout.xaxis.range.map(Number);
      Plotly.react(own.place, tracesOf(own.panel, range, columnsOf(own.place)), layoutOf(own.panel, range), CONFIG);
    }
  }

  function register() {
    for (const [name, list] of Object.entries(content.figures || {})) {
      const group = list.map((panel, k) => ({ panel, place: document.getElementById(`${name}.${k}`), drawn: false }));
      for (const own of group) {
        own.beside = () => own.panel.group ? group.filter(other => other !== own) : [];
        panels.set(own.place.id, own);
        keys(own);
      }
    }
  }

  function load(text) {
    return new Promise((done, failed) => {
      const script = document.createElement("script");
      script.src = URL.createObjectURL(new Blob([text], { type: "text/javascript" }));
      script.onload = done;
      script.onerror = () => failed(new Error("Plotly could not be loaded"));
      document.head.append(script);
    });
  }

  /* Plotly, unpacked and run by the first that needs it */
  let loading = null;
  function plotly() {
    if (!loading) loading = inflated("plotly").then(load).then(() => performance.mark("plotly"));
    return loading;
  }

  const painted = () => new Promise(done => requestAnimationFrame(() => setTimeout(done)));
  const seen = () => [...panels.values()].filter(own => {
    const at = own.place.getBoundingClientRect();
    return at.top < innerHeight && at.bottom > 0;
  });

  async function begin() {
    performance.mark("begin");
    await unpack();
    performance.mark("numbers");
    register();
    if (window.gearfmuStage && content.stage) window.gearfmuStage(content.stage, array, colour);
    if (seen().length) {
      await plotly();
      for (const own of seen()) draw(own.place);
    }
    await painted();
  }

  /* after the first picture: figures that come near the window, what prints, what changes its colours; then the gears turn */
  async function rest() {
    if (panels.size) {
      addEventListener("beforeprint", () => { if (window.Plotly) { for (const own of panels.values()) draw(own.place); redraw(); } });
      await plotly();
      const watch = new IntersectionObserver(found => found.forEach(entry => {
        if (entry.isIntersecting) { watch.unobserve(entry.target); draw(entry.target); }
      }), { rootMargin: "500px 0px" });
      for (const own of panels.values()) watch.observe(own.place);
      matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
      addEventListener("afterprint", redraw);
    }
    if (page.stage) page.stage.start();
    root.classList.add("complete");
  }

  function failed(error) {
    page.errors.push(String(error));
    root.classList.add("failed");
    console.error(error);
  }

  begin().then(() => { root.classList.add("ready"); performance.mark("ready"); return rest(); }).catch(failed);
})();
