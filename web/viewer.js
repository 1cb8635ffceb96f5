// Plays the frames of a run in three dimensions with WebGL 2 and nothing else.
"use strict";
(async () => {
  const $ = (id) => document.getElementById(id);
  const meta = JSON.parse($("meta").textContent);
  const root = document.documentElement;
  const css = (name) => getComputedStyle(root).getPropertyValue(name).trim();
  const say = (text) => { $("message").textContent = text; $("message").hidden = text === ""; };
  const frames = meta.times.length;

  function number(v, digits = 4) {
    if (v === null || v === undefined || !Number.isFinite(v)) return "–";
    const a = Math.abs(v);
    if (a < 1e-12) return "0";
    const s = a >= 1e6 || a < 1e-4 ? a.toExponential(digits - 1).replace(/\.?0+e\+?/, "e") : String(Number(a.toPrecision(digits)));
    return (v < 0 ? "−" : "") + s.replace("-", "−");
  }

  // A blob is zlib around, frame by frame, the low bytes and then the high bytes of 16-bit differences from the frame before.
  async function unpack(id, length) {
    const node = $(id);
    if (!node) return null;
    const text = atob(node.textContent);
    node.remove();
    const packed = new Uint8Array(text.length);
    for (let i = 0; i < text.length; ++i) packed[i] = text.charCodeAt(i);
    const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
    const bytes = new Uint8Array(await new Response(stream).arrayBuffer());
    const out = new Uint16Array(length * frames);
    for (let f = 0; f < frames; ++f) {
      const low = 2 * f * length, high = low + length, now = f * length, before = now - length;
      for (let i = 0; i < length; ++i) out[now + i] = (f ? out[before + i] : 0) + bytes[low + i] + (bytes[high + i] << 8);
    }
    return out;
  }

  if (typeof DecompressionStream !== "function") { say("This browser is too old to unpack the frames (it has no DecompressionStream)."); return; }
  say("Unpacking frames …");
  const g = meta.ground, p = meta.particles;
  const nodes = g ? g.columns * g.rows : 0;
  const heights = g ? await unpack("blob-height", nodes) : null;
  const pressures = g && g.pressure ? await unpack("blob-pressure", nodes) : null;
  const undisturbed = g ? await (async () => {
    const raw = atob($("blob-undisturbed").textContent), out = new Float32Array(nodes);
    for (let i = 0; i < nodes; ++i) out[i] = g.height.low + g.height.step * (raw.charCodeAt(2 * i) + (raw.charCodeAt(2 * i + 1) << 8));
    return out;
  })() : null;
  const places = p ? await unpack("blob-position", 3 * p.count) : null;
  const radii = p ? (() => {
    const raw = atob($("blob-radius").textContent), bytes = new Uint8Array(raw.length);
    for (let i = 0; i < raw.length; ++i) bytes[i] = raw.charCodeAt(i);
    return new Float32Array(bytes.buffer);
  })() : null;

  // ---- small linear algebra, column-major ----
  const mul = (a, b) => { const o = new Float32Array(16); for (let c = 0; c < 4; ++c) for (let r = 0; r < 4; ++r) for (let k = 0; k < 4; ++k) o[4 * c + r] += a[4 * k + r] * b[4 * c + k]; return o; };
  const sub = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const unit = (a) => { const n = Math.hypot(...a) || 1; return [a[0] / n, a[1] / n, a[2] / n]; };
  function look(eye, at) {
    const z = unit(sub(eye, at)), x = unit(cross([0, 0, 1], z)), y = cross(z, x);
    return new Float32Array([x[0], y[0], z[0], 0, x[1], y[1], z[1], 0, x[2], y[2], z[2], 0, -dot(x, eye), -dot(y, eye), -dot(z, eye), 1]);
  }
  function perspective(fov, aspect, near, far) {
    const f = 1 / Math.tan(fov / 2);
    return new Float32Array([f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (far + near) / (near - far), -1, 0, 0, 2 * far * near / (near - far), 0]);
  }
  // Pose (x y z, w x y z) as a matrix, between two frames.
  function pose_matrix(a, b, t) {
    const s = a[3] * b[3] + a[4] * b[4] + a[5] * b[5] + a[6] * b[6] < 0 ? -1 : 1;
    let [w, x, y, z] = [3, 4, 5, 6].map((k) => (1 - t) * a[k] + t * s * b[k]);
    const n = Math.hypot(w, x, y, z);
    w /= n; x /= n; y /= n; z /= n;
    const at = [0, 1, 2].map((k) => (1 - t) * a[k] + t * b[k]);
    return new Float32Array([1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y), 0, 2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x), 0,
      2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y), 0, at[0], at[1], at[2], 1]);
  }

  // ---- meshes: positions and normals, flat ----
  function mesh() {
    const v = [];
    const tri = (a, b, c) => { const n = unit(cross(sub(b, a), sub(c, a))); v.push(...a, ...n, ...b, ...n, ...c, ...n); };
    const quad = (a, b, c, d) => { tri(a, b, c); tri(a, c, d); };
    return { v, tri, quad };
  }
  function wheel_mesh(b) {
    const m = mesh(), n = 72, r = b.radius, w = b.width / 2, hub = 0.28 * r, inner = 0.86 * r;
    const on = (a, radius, y) => [radius * Math.sin(a), y, radius * Math.cos(a)];
    for (let i = 0; i < n; ++i) {
      const a = 2 * Math.PI * i / n, c = 2 * Math.PI * (i + 1) / n;
      m.quad(on(a, r, -w), on(a, r, w), on(c, r, w), on(c, r, -w));
      for (const y of [-w, w]) {
        const s = y > 0 ? [a, c] : [c, a];
        m.quad(on(s[0], inner, y), on(s[1], inner, y), on(s[1], r, y), on(s[0], r, y));
        m.quad(on(s[0], 0, 0.8 * y), on(s[1], 0, 0.8 * y), on(s[1], hub, 0.8 * y), on(s[0], hub, 0.8 * y));
        // Spokes show that the wheel turns.
        if (Math.floor(i / 6) % 2 === 0) m.quad(on(s[0], hub, 0.72 * y), on(s[1], hub, 0.72 * y), on(s[1], inner, 0.72 * y), on(s[0], inner, 0.72 * y));
        else m.quad(on(s[0], hub, 0.3 * y), on(s[1], hub, 0.3 * y), on(s[1], inner, 0.3 * y), on(s[0], inner, 0.3 * y));
      }
      m.quad(on(c, inner, -w), on(c, inner, w), on(a, inner, w), on(a, inner, -w));
    }
    for (let i = 0; i < b.grouser_count; ++i) {
      const a = 2 * Math.PI * i / b.grouser_count, h = Math.max(b.grouser_thickness, 0.004 * r) / 2;
      const e = [-Math.sin(a), -Math.cos(a)], t = [-Math.cos(a), Math.sin(a)];  // the first points down
      const at = (radius, side, y) => [radius * e[0] + side * h * t[0], y, radius * e[1] + side * h * t[1]];
      const o = r + b.grouser_height, i0 = 0.98 * r;
      m.quad(at(o, -1, -w), at(o, -1, w), at(o, 1, w), at(o, 1, -w));
      m.quad(at(i0, 1, -w), at(o, 1, -w), at(o, 1, w), at(i0, 1, w));
      m.quad(at(i0, -1, w), at(o, -1, w), at(o, -1, -w), at(i0, -1, -w));
      for (const y of [-w, w]) m.quad(at(i0, -1, y), at(i0, 1, y), at(o, 1, y), at(o, -1, y));
    }
    return m.v;
  }
  function box_mesh(s) {
    const m = mesh(), [x, y, z] = s.map((e) => e / 2);
    for (let k = 0; k < 3; ++k)
      for (const d of [-1, 1]) {
        const c = [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([u, w]) => { const q = [0, 0, 0]; q[k] = d; q[(k + 1) % 3] = u * d; q[(k + 2) % 3] = w; return [q[0] * x, q[1] * y, q[2] * z]; });
        m.quad(...c);
      }
    return m.v;
  }
  function ball_mesh(r) {
    const m = mesh(), n = 24, at = (i, j) => { const a = Math.PI * i / n, b = 2 * Math.PI * j / n; return [r * Math.sin(a) * Math.cos(b), r * Math.sin(a) * Math.sin(b), r * Math.cos(a)]; };
    for (let i = 0; i < n; ++i) for (let j = 0; j < n; ++j) m.quad(at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
    return m.v;
  }
  // Along +x, length 1.
  function arrow_mesh() {
    const m = mesh(), n = 20, at = (a, r, x) => [x, r * Math.cos(a), r * Math.sin(a)];
    for (let i = 0; i < n; ++i) {
      const a = 2 * Math.PI * i / n, c = 2 * Math.PI * (i + 1) / n;
      m.quad(at(a, 0.018, 0), at(c, 0.018, 0), at(c, 0.018, 0.8), at(a, 0.018, 0.8));
      m.tri(at(a, 0.055, 0.8), at(c, 0.055, 0.8), [1, 0, 0]);
      m.tri(at(c, 0.055, 0.8), at(a, 0.055, 0.8), [0.8, 0, 0]);
    }
    return m.v;
  }

  // ---- WebGL ----
  const canvas = $("view");
  const gl = canvas.getContext("webgl2", { antialias: true, alpha: true, premultipliedAlpha: false, preserveDrawingBuffer: true });
  function program(vertex, fragment) {
    const o = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const s = gl.createShader(kind);
      gl.shaderSource(s, "#version 300 es\nprecision highp float;precision highp int;precision highp sampler2D;\n" + text);
      gl.compileShader(s);
      if (!gl.getShaderParameter(s, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(s));
      gl.attachShader(o, s);
    }
    gl.linkProgram(o);
    if (!gl.getProgramParameter(o, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(o));
    const places_of = {};
    return { o, u: (name) => (places_of[name] ??= gl.getUniformLocation(o, name)) };
  }
  const light = "vec3 lit(vec3 c,vec3 n){float d=max(dot(n,normalize(vec3(-.35,-.55,.85))),0.);float s=.5+.5*n.z;return c*(.36+.22*s+.5*d);}\n";
  const soil = [[0, 222, 208, 178], [0.12, 214, 178, 122], [0.4, 199, 112, 62], [0.7, 150, 44, 60], [1, 62, 16, 62]];
  const viridis = [[0, 68, 1, 84], [0.25, 59, 82, 139], [0.5, 33, 145, 140], [0.75, 94, 201, 98], [1, 253, 231, 37]];
  function ramp(stops) {
    const out = new Uint8Array(256 * 4);
    for (let i = 0; i < 256; ++i) {
      const t = i / 255, k = Math.max(1, stops.findIndex((s) => s[0] >= t)), a = stops[k - 1], b = stops[k], f = (t - a[0]) / (b[0] - a[0]);
      for (let c = 0; c < 3; ++c) out[4 * i + c] = Math.round(a[c + 1] * (1 - f) + b[c + 1] * f);
      out[4 * i + 3] = 255;
    }
    return out;
  }
  const ramp_css = (stops) => "linear-gradient(90deg," + stops.map((s) => "rgb(" + s.slice(1).join(",") + ") " + 100 * s[0] + "%").join(",") + ")";

  let draw_scene = null;
  const state = { frame: 0, part: 0, playing: false, forces: true, follow: true, ground: "sinkage", grains: "speed", speed: 1,
                  az: -1.05, el: 0.42, distance: 1, target: [0, 0, 0], pan: [0, 0, 0] };

  // What there is to see decides where the camera stands.
  const lo = [Infinity, Infinity, Infinity], hi = [-Infinity, -Infinity, -Infinity];
  const see = (q) => { for (let k = 0; k < 3; ++k) { lo[k] = Math.min(lo[k], q[k]); hi[k] = Math.max(hi[k], q[k]); } };
  if (g) { see([g.x0, g.y0, g.height.low]); see([g.x0 + (g.columns - 1) * g.spacing, g.y0 + (g.rows - 1) * g.spacing, g.height.low + g.height.span]); }
  if (p) { see(p.low); see([0, 1, 2].map((k) => p.low[k] + 65535 * p.step[k] * (p.span[k] / 65535))); }
  let reach = 0;
  for (const b of meta.bodies) {
    const size = b.radius ? b.radius + (b.grouser_height || 0) : Math.hypot(...b.size) / 2;
    reach = Math.max(reach, size);
    for (const q of b.poses) { see([q[0] - size, q[1] - size, q[2] - size]); see([q[0] + size, q[1] + size, q[2] + size]); }
  }
  const extent = Math.hypot(...sub(hi, lo));
  const middle = [0, 1, 2].map((k) => 0.5 * (lo[k] + hi[k]));
  state.follow = meta.bodies.length > 0 && extent > 12 * reach;
  state.distance = state.follow ? 9 * reach : 1.05 * extent;
  $("follow").checked = state.follow;

  // Largest values, for scales that stay put while the run plays.
  let sinkage_most = 0, speed_most = 0, force_most = 0;
  if (g) for (let f = 0; f < frames; ++f) for (let i = 0; i < nodes; ++i)
    sinkage_most = Math.max(sinkage_most, undisturbed[i] - (g.height.low + g.height.step * heights[f * nodes + i]));
  for (const b of meta.bodies) for (const q of b.forces) force_most = Math.max(force_most, Math.hypot(...q));
  if (p && frames > 1) {
    const speeds = [];
    const stride = Math.max(1, Math.floor(p.count / 4000));
    for (let f = 1; f < frames; f += Math.max(1, Math.floor(frames / 25)))
      for (let i = 0; i < p.count; i += stride) {
        let s = 0;
        for (let k = 0; k < 3; ++k) { const d = (places[(3 * f + k) * p.count + i] - places[(3 * (f - 1) + k) * p.count + i]) * p.step[k]; if (Math.abs(d) < 0.5 * p.span[k]) s += d * d; }
        speeds.push(Math.sqrt(s) / (meta.times[f] - meta.times[f - 1]));
      }
    speeds.sort((a, b) => a - b);
    speed_most = speeds[Math.floor(0.999 * (speeds.length - 1))] || 0;
  }
  const radius_low = p ? radii.reduce((a, b) => Math.min(a, b), Infinity) : 0, radius_high = p ? radii.reduce((a, b) => Math.max(a, b), 0) : 0;

  if (!gl) {
    say("This browser offers no WebGL 2, which the picture needs. The channels below still play.");
  } else {
    const ground_program = g && program(`
      uniform sampler2D h0,h1,base,q0,q1; uniform mat4 view; uniform vec3 grid; uniform ivec2 size; uniform float part,most; uniform int by; out vec3 n; out float value;
      float h(ivec2 i){i=clamp(i,ivec2(0),size-1);return mix(texelFetch(h0,i,0).r,texelFetch(h1,i,0).r,part);}
      void main(){ivec2 i=ivec2(gl_VertexID%size.x,gl_VertexID/size.x);float z=h(i);
        n=normalize(vec3(h(i-ivec2(1,0))-h(i+ivec2(1,0)),h(i-ivec2(0,1))-h(i+ivec2(0,1)),2.*grid.z));
        value=by==0?(texelFetch(base,i,0).r-z)/most:mix(texelFetch(q0,i,0).r,texelFetch(q1,i,0).r,part)/most;
        gl_Position=view*vec4(grid.xy+vec2(i)*grid.z,z,1.);}`,
      light + "uniform sampler2D colours; in vec3 n; in float value; out vec4 c; void main(){vec3 b=texture(colours,vec2(clamp(value,.002,.998),.5)).rgb;c=vec4(lit(b,normalize(n)),1.);}");
    const body_program = program(
      "uniform mat4 view,pose; layout(location=0) in vec3 at; layout(location=1) in vec3 normal; out vec3 n; void main(){n=mat3(pose)*normal;gl_Position=view*pose*vec4(at,1.);}",
      light + "uniform vec3 colour; in vec3 n; out vec4 c; void main(){vec3 m=normalize(n);c=vec4(lit(colour,gl_FrontFacing?m:-m),1.);}");
    const grain_program = p && program(`
      uniform mat4 view; uniform vec3 low,scale,span; uniform float part,pixels,most,dt,rlow,rhigh; uniform int by; layout(location=0) in float x0; layout(location=1) in float y0; layout(location=2) in float z0;
      layout(location=3) in float x1; layout(location=4) in float y1; layout(location=5) in float z1; layout(location=6) in float radius; out float value;
      void main(){vec3 a=vec3(x0,y0,z0)*scale,b=vec3(x1,y1,z1)*scale,d=b-a;d*=step(abs(d),.5*span);value=by==0?length(d)/dt/most:(radius-rlow)/max(rhigh-rlow,1e-12);
        gl_Position=view*vec4(low+a+part*d,1.);gl_PointSize=max(1.5,2.*radius*pixels/gl_Position.w);}`,
      light + "uniform sampler2D colours; uniform mat3 eye; in float value; out vec4 c; void main(){vec2 q=2.*gl_PointCoord-1.;float r=dot(q,q);if(r>1.)discard;vec3 n=eye*vec3(q.x,-q.y,sqrt(1.-r));c=vec4(lit(texture(colours,vec2(clamp(value,.002,.998),.5)).rgb,n),1.);}");

    const texture = (unit_number) => {
      const t = gl.createTexture();
      gl.activeTexture(gl.TEXTURE0 + unit_number);
      gl.bindTexture(gl.TEXTURE_2D, t);
      for (const k of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, k, gl.NEAREST);
      for (const k of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, k, gl.CLAMP_TO_EDGE);
      return t;
    };
    const upload = (unit_number, t, values) => {
      gl.activeTexture(gl.TEXTURE0 + unit_number);
      gl.bindTexture(gl.TEXTURE_2D, t);
      gl.texImage2D(gl.TEXTURE_2D, 0, gl.R32F, g.columns, g.rows, 0, gl.RED, gl.FLOAT, values);
    };
    const colour_texture = (unit_number, stops) => {
      const t = texture(unit_number);
      gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, 256, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, ramp(stops));
      return t;
    };
    const ramps = [colour_texture(5, soil), colour_texture(6, viridis)];

    let ground = null;
    if (g) {
      const index = new Uint32Array(6 * (g.columns - 1) * (g.rows - 1));
      let k = 0;
      for (let j = 0; j + 1 < g.rows; ++j)
        for (let i = 0; i + 1 < g.columns; ++i) { const a = j * g.columns + i, b = a + g.columns; index.set([a, a + 1, b, b, a + 1, b + 1], k); k += 6; }
      const vao = gl.createVertexArray();
      gl.bindVertexArray(vao);
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
      gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, index, gl.STATIC_DRAW);
      gl.bindVertexArray(null);
      ground = { vao, count: index.length, h: [texture(0), texture(1)], base: texture(2), q: [texture(3), texture(4)], at: -1, row: new Float32Array(nodes) };
      upload(2, ground.base, undisturbed);
    }
    const load_ground = (f) => {
      if (ground.at === f) return;
      ground.at = f;
      const next = Math.min(f + 1, frames - 1);
      [f, next].forEach((k, s) => {
        for (let i = 0; i < nodes; ++i) ground.row[i] = g.height.low + g.height.step * heights[k * nodes + i];
        upload(s, ground.h[s], ground.row);
        if (pressures) for (let i = 0; i < nodes; ++i) ground.row[i] = g.pressure.step * pressures[k * nodes + i];
        upload(3 + s, ground.q[s], ground.row);
      });
    };

    const solid = (v) => {
      const vao = gl.createVertexArray();
      gl.bindVertexArray(vao);
      gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
      gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(v), gl.STATIC_DRAW);
      for (const k of [0, 1]) { gl.enableVertexAttribArray(k); gl.vertexAttribPointer(k, 3, gl.FLOAT, false, 24, 12 * k); }
      gl.bindVertexArray(null);
      return { vao, count: v.length / 6 };
    };
    const bodies = meta.bodies.map((b) => solid(b.shape === "wheel" ? wheel_mesh(b) : b.shape === "box" ? box_mesh(b.size) : ball_mesh(b.radius)));
    const arrow = solid(arrow_mesh());

    let grains = null;
    if (p) {
      const vao = gl.createVertexArray(), all = gl.createBuffer(), size = gl.createBuffer();
      gl.bindVertexArray(vao);
      gl.bindBuffer(gl.ARRAY_BUFFER, all);
      gl.bufferData(gl.ARRAY_BUFFER, places, gl.STATIC_DRAW);
      for (let k = 0; k < 6; ++k) gl.enableVertexAttribArray(k);
      gl.bindBuffer(gl.ARRAY_BUFFER, size);
      gl.bufferData(gl.ARRAY_BUFFER, radii, gl.STATIC_DRAW);
      gl.enableVertexAttribArray(6);
      gl.vertexAttribPointer(6, 1, gl.FLOAT, false, 0, 0);
      gl.bindVertexArray(null);
      grains = { vao, all };
    }
    const rgb = (hex) => [1, 3, 5].map((k) => parseInt(hex.slice(k, k + 2), 16) / 255);
    const metal = [0.62, 0.65, 0.69];

    draw_scene = () => {
      const w = Math.round(canvas.clientWidth * devicePixelRatio), h = Math.round(canvas.clientHeight * devicePixelRatio);
      if (canvas.width !== w || canvas.height !== h) { canvas.width = w; canvas.height = h; }
      gl.viewport(0, 0, w, h);
      gl.clearColor(0, 0, 0, 0);
      gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
      gl.enable(gl.DEPTH_TEST);
      const f = state.frame, next = Math.min(f + 1, frames - 1), t = state.part;
      const focus = state.follow ? [0, 1, 2].map((k) => meta.bodies[0].poses[f][k] * (1 - t) + meta.bodies[0].poses[next][k] * t) : middle;
      const at = [0, 1, 2].map((k) => focus[k] + state.pan[k]);
      const out = [Math.cos(state.el) * Math.cos(state.az), Math.cos(state.el) * Math.sin(state.az), Math.sin(state.el)];
      const eye = [0, 1, 2].map((k) => at[k] + state.distance * out[k]);
      const fov = 0.62, narrow = Math.min(1, w / h);
      const camera = look(eye, at), lens = perspective(2 * Math.atan(Math.tan(fov / 2) / narrow), w / h, 0.02 * state.distance, 30 * state.distance + extent);
      const view = mul(lens, camera);
      if (ground) {
        load_ground(f);
        const q = ground_program;
        gl.useProgram(q.o);
        ground.h.concat([ground.base], ground.q).forEach((tx, k) => { gl.activeTexture(gl.TEXTURE0 + k); gl.bindTexture(gl.TEXTURE_2D, tx); });
        ["h0", "h1", "base", "q0", "q1", "colours"].forEach((name, k) => gl.uniform1i(q.u(name), k));
        gl.uniformMatrix4fv(q.u("view"), false, view);
        gl.uniform3f(q.u("grid"), g.x0, g.y0, g.spacing);
        gl.uniform2i(q.u("size"), g.columns, g.rows);
        gl.uniform1f(q.u("part"), t);
        gl.uniform1i(q.u("by"), state.ground === "pressure" ? 1 : 0);
        gl.uniform1f(q.u("most"), (state.ground === "pressure" ? g.pressure.high : sinkage_most) || 1);
        gl.bindVertexArray(ground.vao);
        gl.drawElements(gl.TRIANGLES, ground.count, gl.UNSIGNED_INT, 0);
      }
      if (grains) {
        const q = grain_program, n = p.count;
        gl.useProgram(q.o);
        gl.bindVertexArray(grains.vao);
        gl.bindBuffer(gl.ARRAY_BUFFER, grains.all);
        for (let k = 0; k < 3; ++k) {
          gl.vertexAttribPointer(k, 1, gl.UNSIGNED_SHORT, false, 0, 2 * n * (3 * f + k));
          gl.vertexAttribPointer(3 + k, 1, gl.UNSIGNED_SHORT, false, 0, 2 * n * (3 * next + k));
        }
        gl.uniformMatrix4fv(q.u("view"), false, view);
        gl.uniform3f(q.u("low"), ...p.low);
        gl.uniform3f(q.u("scale"), ...p.step);
        gl.uniform3f(q.u("span"), ...p.span);
        gl.uniform1f(q.u("part"), t);
        gl.uniform1f(q.u("pixels"), 0.5 * h * lens[5]);
        gl.uniform1f(q.u("dt"), next > f ? meta.times[next] - meta.times[f] : 1);
        gl.uniform1f(q.u("most"), speed_most || 1);
        gl.uniform1f(q.u("rlow"), radius_low);
        gl.uniform1f(q.u("rhigh"), radius_high);
        gl.uniform1i(q.u("by"), state.grains === "size" ? 1 : 0);
        gl.uniform1i(q.u("colours"), state.grains === "size" ? 6 : 5);
        gl.activeTexture(gl.TEXTURE5); gl.bindTexture(gl.TEXTURE_2D, ramps[0]);
        gl.activeTexture(gl.TEXTURE6); gl.bindTexture(gl.TEXTURE_2D, ramps[1]);
        gl.uniformMatrix3fv(q.u("eye"), false, new Float32Array([camera[0], camera[4], camera[8], camera[1], camera[5], camera[9], camera[2], camera[6], camera[10]]));
        gl.drawArrays(gl.POINTS, 0, n);
      }
      gl.useProgram(body_program.o);
      gl.uniformMatrix4fv(body_program.u("view"), false, view);
      gl.uniform3f(body_program.u("colour"), ...metal);
      meta.bodies.forEach((b, k) => {
        gl.uniformMatrix4fv(body_program.u("pose"), false, pose_matrix(b.poses[f], b.poses[next], t));
        gl.bindVertexArray(bodies[k].vao);
        gl.drawArrays(gl.TRIANGLES, 0, bodies[k].count);
      });
      if (state.forces && force_most > 0) {
        gl.uniform3f(body_program.u("colour"), ...rgb(css("--c0")));
        gl.disable(gl.DEPTH_TEST);
        meta.bodies.forEach((b) => {
          const force = [0, 1, 2].map((k) => (1 - t) * b.forces[f][k] + t * b.forces[next][k]), size = Math.hypot(...force);
          if (size < 1e-3 * force_most) return;
          const from = [0, 1, 2].map((k) => (1 - t) * b.poses[f][k] + t * b.poses[next][k]);
          const x = unit(force), y = unit(cross(Math.abs(x[2]) < 0.9 ? [0, 0, 1] : [0, 1, 0], x)), z = cross(x, y), s = 2.2 * reach * size / force_most, th = 1.3 * reach;
          gl.uniformMatrix4fv(body_program.u("pose"), false, new Float32Array([...x.map((e) => e * s), 0, ...y.map((e) => e * th), 0, ...z.map((e) => e * th), 0, ...from, 1]));
          gl.bindVertexArray(arrow.vao);
          gl.drawArrays(gl.TRIANGLES, 0, arrow.count);
        });
      }
    };

    // ---- hands on the camera ----
    const hands = new Map();
    canvas.addEventListener("pointerdown", (e) => { canvas.setPointerCapture(e.pointerId); hands.set(e.pointerId, [e.clientX, e.clientY]); });
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, (e) => hands.delete(e.pointerId));
    canvas.addEventListener("contextmenu", (e) => e.preventDefault());
    const pan = (dx, dy) => {
      const k = state.distance / canvas.clientHeight, right = [-Math.sin(state.az), Math.cos(state.az), 0];
      const up = [-Math.sin(state.el) * Math.cos(state.az), -Math.sin(state.el) * Math.sin(state.az), Math.cos(state.el)];
      for (let i = 0; i < 3; ++i) state.pan[i] += k * (-dx * right[i] + dy * up[i]);
    };
    const spread = () => { const [a, b] = [...hands.values()]; return [Math.hypot(a[0] - b[0], a[1] - b[1]), (a[0] + b[0]) / 2, (a[1] + b[1]) / 2]; };
    canvas.addEventListener("pointermove", (e) => {
      const was = hands.get(e.pointerId);
      if (!was) return;
      if (hands.size === 2) {
        const a = spread();
        hands.set(e.pointerId, [e.clientX, e.clientY]);
        const b = spread();
        state.distance *= a[0] / Math.max(b[0], 1);
        pan(b[1] - a[1], b[2] - a[2]);
      } else {
        hands.set(e.pointerId, [e.clientX, e.clientY]);
        const dx = e.clientX - was[0], dy = e.clientY - was[1];
        if (e.buttons & 6 || e.shiftKey) pan(dx, dy);
        else { state.az -= 0.008 * dx; state.el = Math.min(1.55, Math.max(-0.3, state.el + 0.008 * dy)); }
      }
      redraw();
    });
    canvas.addEventListener("wheel", (e) => { e.preventDefault(); state.distance *= Math.exp(0.0012 * e.deltaY); redraw(); }, { passive: false });
    say("");
  }

  function legend() {
    const box = $("legend");
    box.textContent = "";
    const entry = (title, stops, from, to) => {
      const d = document.createElement("div"), i = document.createElement("i"), s = document.createElement("span");
      d.append(title, i, s);
      i.style.background = ramp_css(stops);
      for (const v of [from, to]) { const e = document.createElement("em"); e.style.fontStyle = "normal"; e.textContent = v; s.append(e); }
      box.append(d);
    };
    if (g && state.ground === "sinkage") entry("Sinkage of the ground [mm]", soil, "0", number(1e3 * sinkage_most, 3));
    if (g && state.ground === "pressure") entry("Normal stress [kPa]", soil, "0", number(1e-3 * g.pressure.high, 3));
    if (p && state.grains === "speed") entry("Speed of particles [m/s]", soil, "0", number(speed_most, 3));
    if (p && state.grains === "size") entry("Radius of particles [mm]", viridis, number(1e3 * radius_low, 3), number(1e3 * radius_high, 3));
    if (state.forces && force_most > 0) {
      const d = document.createElement("div");
      d.textContent = "Arrow: force of the soil, at most " + number(force_most, 3) + " N";
      box.append(d);
    }
  }

  // ---- channels under the picture ----
  const panels = meta.channels.map((c) => {
    const d = document.createElement("div"), head = document.createElement("header"), name = document.createElement("span"), value = document.createElement("b"), area = document.createElement("canvas");
    d.className = "channel";
    name.textContent = c.label;
    head.append(name, value);
    d.append(head, area);
    $("channels").append(d);
    const seen = c.values.filter((v) => v !== null);
    let low = Math.min(...seen), high = Math.max(...seen);
    if (!(high > low)) { low -= 0.5; high += 0.5; }
    const seek_here = (e) => { const b = area.getBoundingClientRect(); seek(meta.times[0] + (e.clientX - b.left) / b.width * (meta.times[frames - 1] - meta.times[0])); };
    area.addEventListener("pointerdown", (e) => { area.setPointerCapture(e.pointerId); seek_here(e); });
    area.addEventListener("pointermove", (e) => { if (e.buttons) seek_here(e); });
    return { c, value, area, low, high };
  });
  const place = (t, v) => { let a = 0, b = v.length - 1; while (b - a > 1) { const m = (a + b) >> 1; if (v[m] <= t) a = m; else b = m; } return t - v[a] < v[b] - t ? a : b; };
  function draw_channels(t) {
    const t0 = meta.times[0], span = meta.times[frames - 1] - t0 || 1;
    for (const { c, value, area, low, high } of panels) {
      const r = devicePixelRatio, w = area.clientWidth * r, h = area.clientHeight * r, k = area.getContext("2d");
      if (area.width !== Math.round(w) || area.height !== Math.round(h)) { area.width = Math.round(w); area.height = Math.round(h); }
      k.clearRect(0, 0, w, h);
      const x = (s) => (s - t0) / span * w, y = (v) => h - 4 * r - (v - low) / (high - low) * (h - 8 * r);
      if (low < 0 && high > 0) { k.strokeStyle = css("--line"); k.lineWidth = r; k.beginPath(); k.moveTo(0, y(0)); k.lineTo(w, y(0)); k.stroke(); }
      k.strokeStyle = css("--c0");
      k.lineWidth = 1.5 * r;
      k.beginPath();
      let down = false;
      c.times.forEach((s, i) => { if (c.values[i] === null) { down = false; return; } if (down) k.lineTo(x(s), y(c.values[i])); else k.moveTo(x(s), y(c.values[i])); down = true; });
      k.stroke();
      k.strokeStyle = css("--ink");
      k.lineWidth = r;
      k.beginPath(); k.moveTo(x(t), 0); k.lineTo(x(t), h); k.stroke();
      value.textContent = number(c.values[place(t, c.times)]) + (c.unit ? " " + c.unit : "");
    }
  }

  // ---- time ----
  const now = () => { const f = state.frame, n = Math.min(f + 1, frames - 1); return meta.times[f] * (1 - state.part) + meta.times[n] * state.part; };
  let pending = false;
  function redraw() {
    if (pending) return;
    pending = true;
    requestAnimationFrame(() => {
      pending = false;
      draw_scene?.();
      const t = now();
      draw_channels(t);
      $("time").value = String(t);
      $("clock").textContent = t.toFixed(2) + " of " + meta.times[frames - 1].toFixed(2) + " s";
    });
  }
  function seek(t) {
    const end = meta.times[frames - 1];
    t = Math.min(Math.max(t, meta.times[0]), end);
    let f = place(t, meta.times);
    if (meta.times[f] > t) --f;
    f = Math.max(0, Math.min(f, frames - 1));
    state.frame = f;
    state.part = f + 1 < frames ? (t - meta.times[f]) / (meta.times[f + 1] - meta.times[f]) : 0;
    redraw();
  }
  let last = 0;
  function tick(stamp) {
    if (!state.playing) return;
    const dt = Math.min(0.1, (stamp - last) / 1000 || 0);
    last = stamp;
    const t = now() + dt * state.speed;
    if (t >= meta.times[frames - 1]) { seek(meta.times[frames - 1]); play(false); return; }
    seek(t);
    requestAnimationFrame(tick);
  }
  function play(on) {
    state.playing = on;
    $("play").innerHTML = on ? '<svg viewBox="0 0 16 16"><path d="M3 2h4v12H3zM9 2h4v12H9z"/></svg>' : '<svg viewBox="0 0 16 16"><path d="M4 2l10 6-10 6z"/></svg>';
    $("play").title = on ? "Pause" : "Play";
    if (on) {
      if (now() >= meta.times[frames - 1]) seek(meta.times[0]);
      last = performance.now();
      requestAnimationFrame(tick);
    }
  }
  $("time").min = meta.times[0];
  $("time").max = meta.times[frames - 1];
  $("time").step = "any";
  $("time").oninput = (e) => { play(false); seek(Number(e.target.value)); };
  $("play").onclick = () => play(!state.playing);
  $("speed").onchange = (e) => { state.speed = Number(e.target.value); };
  const choose = (id, key) => { const e = $(id); if (e) e.onchange = () => { state[key] = e.type === "checkbox" ? e.checked : e.value; legend(); redraw(); }; };
  choose("ground-by", "ground"); choose("grains-by", "grains"); choose("forces", "forces"); choose("follow", "follow");
  $("look").onchange = (e) => {
    [state.az, state.el] = { oblique: [-1.05, 0.42], side: [-Math.PI / 2, 0.06], front: [0.001, 0.15], top: [-Math.PI / 2, 1.55] }[e.target.value];
    state.pan = [0, 0, 0];
    redraw();
  };
  document.querySelector(".theme").onclick = () => {
    const dark = root.dataset.theme ? root.dataset.theme === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
    root.dataset.theme = dark ? "light" : "dark";
    redraw();
  };
  addEventListener("keydown", (e) => {
    if (e.target.tagName === "SELECT" || e.target.tagName === "INPUT") return;
    if (e.key === " ") { e.preventDefault(); play(!state.playing); }
    if (e.key === "ArrowRight") { play(false); seek(meta.times[Math.min(state.frame + 1, frames - 1)]); }
    if (e.key === "ArrowLeft") { play(false); seek(meta.times[Math.max(state.frame - (state.part > 0 ? 0 : 1), 0)]); }
  });
  new ResizeObserver(redraw).observe($("stage"));
  play(false);
  legend();
  seek(meta.times[0]);
  // For tests: what was unpacked, and where the player stands.
  window.terrode_view = {
    height: (f, i, j) => g.height.low + g.height.step * heights[f * nodes + j * g.columns + i],
    position: (f, n) => [0, 1, 2].map((k) => p.low[k] + p.step[k] * places[(3 * f + k) * p.count + n]),
    seek, state, sinkage_most, speed_most, has_picture: gl !== null,
    // Draws now and says how many pixels are not background.
    painted: () => { draw_scene(); const a = new Uint8Array(4 * canvas.width * canvas.height); gl.readPixels(0, 0, canvas.width, canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, a); let n = 0; for (let i = 3; i < a.length; i += 4) n += a[i] > 0; return n / (canvas.width * canvas.height); },
  };
  root.dataset.ready = String(frames);
})();
