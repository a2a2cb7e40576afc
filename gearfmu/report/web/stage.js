"use strict";
/* The deformed stage in WebGL 2: gears turn by their recorded angles; displacements are sums of stored fields, computed
   at every frame (gearfmu/report/moving.py says what of). */
window.gearfmuStage = (stage, array, colour) => {
  const place = document.getElementById("stage"), canvas = place.querySelector("canvas");
  const gl = canvas.getContext("webgl2", { antialias: true, preserveDrawingBuffer: true });
  if (!gl) { place.classList.add("none"); place.querySelector("figcaption").textContent = "This browser has no WebGL 2: the turning view is left out."; return; }
  const time = array(stage.time), last = time.length - 1, state = { at: 0, scale: stage.scale, yaw: -0.3, pitch: 0.35, zoom: 1, close: false, running: false };

  const VERTEX = `#version 300 es
    in vec3 base; in vec3 moved; uniform mat3 view; uniform vec3 origin, frame; uniform vec2 turn; uniform float enlarge, most, line;
    out vec3 seen; out float value;
    void main() { vec3 p = base + enlarge * moved; p = vec3(turn.x * p.x - turn.y * p.y, turn.y * p.x + turn.x * p.y, p.z) + origin;
      seen = view * p; value = length(moved) / most; gl_Position = vec4(seen.xy * frame.xy, -seen.z * frame.z - line * 4e-3, 1.0); }`;
  const FRAGMENT = `#version 300 es
    precision highp float; in vec3 seen; in float value; uniform highp float line, tone; out vec4 colour;
    vec3 ramp(float v) { vec3 c[5] = vec3[5](vec3(.839,.863,.89), vec3(.64,.749,.847), vec3(.31,.533,.722), vec3(.886,.651,.243), vec3(.733,.227,.149));
      float k = clamp(v, 0., 1.) * 4.; int i = int(min(floor(k), 3.)); return mix(c[i], c[i + 1], k - float(i)); }
    void main() { vec3 n = normalize(cross(dFdx(seen), dFdy(seen))); if (n.z < 0.) n = -n;
      float light = .7 + .4 * max(dot(n, normalize(vec3(-.4, .6, .7))), 0.);
      vec3 c = tone > 0. ? tone * vec3(.42, .46, .52) : ramp(value); colour = line > .5 ? vec4(vec3(.1, .15, .2) * .22, .22) : vec4(c * light, 1.); }`;

  function shader(kind, text) {
    const found = gl.createShader(kind);
    gl.shaderSource(found, text.trim());
    gl.compileShader(found);
    if (!gl.getShaderParameter(found, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(found));
    return found;
  }
  const program = gl.createProgram();
  gl.attachShader(program, shader(gl.VERTEX_SHADER, VERTEX));
  gl.attachShader(program, shader(gl.FRAGMENT_SHADER, FRAGMENT));
  gl.linkProgram(program);
  gl.useProgram(program);
  const at = name => gl.getUniformLocation(program, name), BASE = gl.getAttribLocation(program, "base"), MOVED = gl.getAttribLocation(program, "moved");

  const APART = 7; /* pixels between lines of the mesh below which they are left out */

  function bodyOf(own) {
    const size = own.size, teeth = own.teeth, count = size * teeth, sector = array(own.points), base = new Float32Array(3 * count);
    for (let j = 0; j < teeth; j++) {
      const c = Math.cos(2 * Math.PI * j / teeth), s = Math.sin(2 * Math.PI * j / teeth);
      for (let i = 0, k = 3 * j * size; i < size; i++, k += 3) {
        base[k] = c * sector[3 * i] - s * sector[3 * i + 1]; base[k + 1] = s * sector[3 * i] + c * sector[3 * i + 1]; base[k + 2] = sector[3 * i + 2];
      }
    }
    const quads = array(own.quads), ahead = array(own.ahead), faces = [], lines = [];
    for (let j = 0; j < teeth; j++) for (let q = 0; q < quads.length; q += 4) {
      const p = [0, 1, 2, 3].map(k => ((j + ahead[q + k]) % teeth) * size + quads[q + k]);
      faces.push(p[0], p[1], p[2], p[0], p[2], p[3]);
      lines.push(p[0], p[1], p[1], p[2]);
    }
    const point = p => base.subarray(3 * p, 3 * p + 3), edges = [];
    for (let k = 0; k < quads.length; k += 2) { const [a, b] = [point(lines[k]), point(lines[k + 1])]; edges.push(Math.hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2])); }
    const buffer = (kind, data, use) => { const b = gl.createBuffer(); gl.bindBuffer(kind, b); gl.bufferData(kind, data, use); return b; };
    gl.bindVertexArray(null);
    return { own, count, moved: new Float32Array(3 * count), bases: buffer(gl.ARRAY_BUFFER, base, gl.STATIC_DRAW), moves: buffer(gl.ARRAY_BUFFER, 12 * count, gl.DYNAMIC_DRAW),
      faces: buffer(gl.ELEMENT_ARRAY_BUFFER, new Uint32Array(faces), gl.STATIC_DRAW), lines: buffer(gl.ELEMENT_ARRAY_BUFFER, new Uint32Array(lines), gl.STATIC_DRAW),
      nFaces: faces.length, nLines: lines.length, edge: edges.sort((a, b) => a - b)[edges.length >> 1], reach: base.reduce((m, v, i) => i % 3 === 0 ? Math.max(m, Math.hypot(v, base[i + 1])) : m, 0) };
  }
  const bodies = stage.bodies.map(bodyOf);
  const xs = bodies.flatMap(b => [...array(b.own.x)].flatMap(x => [x - b.reach, x + b.reach])), ys = bodies.flatMap(b => [...array(b.own.y)].flatMap(y => [y - b.reach, y + b.reach]));
  const box = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)], zs = bodies.map(b => b.own.z), middle = (Math.min(...zs) + Math.max(...zs)) / 2;
  const deep = Math.max(box[1] - box[0], box[3] - box[2]) * 1.2 + Math.max(...zs) - Math.min(...zs);

  const between = (values, k, part) => values[k] + part * (values[Math.min(k + 1, last)] - values[k]);

  /* displacement of every point: unit loads at the contacts of both neighbouring frames, blended; or recorded frames */
  function displace(body, k, part) {
    const own = body.own, u = body.moved;
    u.fill(0);
    if (own.frames !== undefined) {
      const times = array(own.times), frames = array(own.frames), t = between(time, k, part);
      let g = 0;
      while (g < times.length - 2 && times[g + 1] < t) g++;
      const b = times.length > 1 ? Math.min(1, Math.max(0, (t - times[g]) / (times[g + 1] - times[g]))) : 0, next = Math.min(g + 1, times.length - 1);
      for (let i = 0, n = u.length; i < n; i++) u[i] = own.step * ((1 - b) * frames[g * n + i] + b * frames[next * n + i]);
    }
    for (const contacts of own.contacts || []) for (const [frame, weight] of [[k, 1 - part], [Math.min(k + 1, last), part]]) {
      if (!weight) continue;
      const rolls = array(own.rolls), unit = array(own.unit), n = u.length, count = rolls.length;
      for (let c = frame * contacts.most; c < (frame + 1) * contacts.most; c++) {
        const force = array(contacts.force)[c], roll = array(contacts.roll)[c], tooth = array(contacts.tooth)[c];
        if (!force) continue;
        let r = 0;
        while (r < count - 2 && rolls[r + 1] < roll) r++;
        const b = Math.min(1, Math.max(0, (roll - rolls[r]) / (rolls[r + 1] - rolls[r]))), first = ((force < 0 ? count : 0) + r) * n, second = first + n;
        const amount = -Math.abs(force) * weight * own.step, angle = 2 * Math.PI * tooth / own.teeth, co = Math.cos(angle), si = Math.sin(angle), shift = 3 * tooth * own.size;
        for (let i = 0, to = shift; i < n; i += 3, to += 3) {
          if (to >= n) to -= n;
          const x = (1 - b) * unit[first + i] + b * unit[second + i], y = (1 - b) * unit[first + i + 1] + b * unit[second + i + 1];
          u[to] += amount * (co * x - si * y); u[to + 1] += amount * (si * x + co * y);
          u[to + 2] += amount * ((1 - b) * unit[first + i + 2] + b * unit[second + i + 2]);
        }
      }
    }
  }

  function draw() {
    const ratio = Math.min(devicePixelRatio || 1, 2), w = Math.round(canvas.clientWidth * ratio), h = Math.round(canvas.clientHeight * ratio);
    if (!w || !h) return;
    if (canvas.width !== w || canvas.height !== h) { canvas.width = w; canvas.height = h; }
    const k = Math.min(Math.floor(state.at), last), part = state.at - k;
    gl.viewport(0, 0, w, h);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    const cy = Math.cos(state.yaw), sy = Math.sin(state.yaw), cp = Math.cos(state.pitch), sp = Math.sin(state.pitch);
    /* columns; right, up and towards the eye are its rows */
    gl.uniformMatrix3fv(at("view"), false, [cy, sp * sy, -cp * sy, 0, cp, sp, sy, -sp * cy, cp * cy]);
    const centre = state.close ? stage.close.map(own => between(array(own), k, part)) : [(box[0] + box[1]) / 2, (box[2] + box[3]) / 2];
    const half = state.close ? [stage.half, stage.half] : [(box[1] - box[0]) / 2 * 1.05, (box[3] - box[2]) / 2 * 1.14];
    const fit = state.zoom * Math.min(w / half[0], h / half[1]);
    gl.uniform3f(at("frame"), fit / w, fit / h, 1 / deep);
    gl.uniform1f(at("most"), stage.most);
    for (const body of bodies) {
      displace(body, k, part);
      const angle = between(array(body.own.angle), k, part) + (body.own.extra === undefined ? 0 : state.scale * between(array(body.own.extra), k, part));
      gl.uniform2f(at("turn"), Math.cos(angle), Math.sin(angle));
      gl.uniform3f(at("origin"), between(array(body.own.x), k, part) - centre[0], between(array(body.own.y), k, part) - centre[1], body.own.z - middle);
      gl.uniform1f(at("enlarge"), state.scale);
      gl.uniform1f(at("tone"), body.own.tone || 0);
      gl[body.own.inside ? "enable" : "disable"](gl.CULL_FACE);
      gl.cullFace(gl.FRONT);
      gl.bindBuffer(gl.ARRAY_BUFFER, body.bases);
      gl.enableVertexAttribArray(BASE);
      gl.vertexAttribPointer(BASE, 3, gl.FLOAT, false, 0, 0);
      gl.bindBuffer(gl.ARRAY_BUFFER, body.moves);
      gl.bufferSubData(gl.ARRAY_BUFFER, 0, body.moved);
      gl.enableVertexAttribArray(MOVED);
      gl.vertexAttribPointer(MOVED, 3, gl.FLOAT, false, 0, 0);
      gl.enable(gl.POLYGON_OFFSET_FILL);
      gl.polygonOffset(2, 8);
      gl.uniform1f(at("line"), 0);
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, body.faces);
      gl.drawElements(gl.TRIANGLES, body.nFaces, gl.UNSIGNED_INT, 0);
      if (!body.own.tone && body.edge * fit / 2 > APART) {
        gl.uniform1f(at("line"), 1);
        gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, body.lines);
        gl.drawElements(gl.LINES, body.nLines, gl.UNSIGNED_INT, 0);
      }
    }
    place.classList.add("drawn");
    place.querySelector("output").textContent = `${(1e3 * between(time, k, part)).toFixed(2)} ms`;
    place.querySelector(".factor").textContent = `${state.scale.toPrecision(3).replace(/\.?0+$/, "")}×`;
  }

  const seconds = 8, button = place.querySelector(".play"), slider = place.querySelector(".moment");
  let before = 0;
  function step(now) {
    if (!state.running) return;
    state.at = (state.at + Math.max(0, Math.min(now - before, 100)) / 1e3 / seconds * last) % last;
    before = now;
    slider.value = String(state.at / last);
    draw();
    requestAnimationFrame(step);
  }
  function run(on) {
    if (on === state.running) return;
    state.running = on;
    button.textContent = on ? "Pause" : "Play";
    if (on) { before = performance.now(); requestAnimationFrame(step); }
  }
  button.addEventListener("click", () => run(!state.running));
  slider.addEventListener("input", () => { run(false); state.at = Number(slider.value) * last; draw(); });
  place.querySelector(".enlarge").addEventListener("input", event => { state.scale = stage.scale * 10 ** Number(event.target.value); if (Number(event.target.value) <= -1) state.scale = 0; draw(); });
  place.querySelector(".closer").addEventListener("click", event => {
    state.close = !state.close; state.zoom = 1;
    [state.yaw, state.pitch] = state.close ? [0, 0] : [-0.3, 0.35];
    event.target.textContent = state.close ? "Whole stage" : "Mesh close up";
    draw();
  });
  let held = null;
  canvas.addEventListener("pointerdown", event => { held = [event.clientX, event.clientY]; canvas.setPointerCapture(event.pointerId); });
  canvas.addEventListener("pointermove", event => {
    if (!held) return;
    state.yaw += (event.clientX - held[0]) / 150; state.pitch = Math.max(-1.5, Math.min(1.5, state.pitch + (event.clientY - held[1]) / 150));
    held = [event.clientX, event.clientY];
    draw();
  });
  for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, () => { held = null; });
  canvas.addEventListener("keydown", event => {
    const turn = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, -0.1], ArrowDown: [0, 0.1] }[event.key], zoom = { "+": 1.15, "-": 1 / 1.15 }[event.key];
    if (!turn && !zoom) return;
    if (turn) { state.yaw += turn[0]; state.pitch += turn[1]; event.preventDefault(); } else state.zoom *= zoom;
    draw();
  });
  new ResizeObserver(draw).observe(canvas); /* its first call draws the first picture */
  addEventListener("beforeprint", draw);
  const calm = matchMedia("(prefers-reduced-motion: reduce)").matches || document.hidden;
  let wanted = !calm;
  const start = () => new IntersectionObserver(found => { if (wanted) run(found[0].isIntersecting); else if (state.running && !found[0].isIntersecting) run(false); }).observe(canvas);
  button.addEventListener("click", () => { wanted = state.running; });
  window.gearfmuPage.stage = { span: [time[0], time[last]], state, draw, run, start, show: frame => { wanted = false; run(false); state.at = frame; slider.value = String(frame / last); draw(); }, displaced: name => { const body = bodies.find(b => b.own.name === name); displace(body, Math.min(Math.floor(state.at), last), 0); return Array.from(body.moved); } };
};
