// Brings the figures of a report to life. The page is complete without it: every figure is there as SVG.
"use strict";
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const colour = (c) => (c < 0 ? css("--ink") : css("--c" + (c % 8)));

  // Four significant digits and a true minus, as in the tables.
  function number(v) {
    if (v === null || v === undefined || Number.isNaN(v)) return "–";
    if (v === 0) return "0";
    const a = Math.abs(v);
    let s = a >= 1e6 || a < 1e-4 ? a.toExponential(3).replace(/\.?0+e\+?/, "e") : String(Number(a.toPrecision(4)));
    s = s.replace("-", "−");
    return (v < 0 ? "−" : "") + s;
  }
  const named = (axis) => axis.label + (axis.unit ? " [" + axis.unit + "]" : "");

  function save(name, type, text) {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([text], { type }));
    link.download = name;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  }

  const quoted = (s) => (/[",\n\r]/.test(s) ? '"' + s.replaceAll('"', '""') + '"' : s);
  const plain = (v) => (v === null || v === undefined ? "" : String(v));

  // One row a point: series, x, y, and the limits where a series has them.
  function csv(f) {
    const bounds = f.series.some((s) => s.low);
    const rows = [["series", named(f.x), named(f.y)].concat(bounds ? ["low", "high"] : []).map(quoted).join(",")];
    for (const s of f.series)
      s.x.forEach((x, i) => {
        const row = [quoted(s.name), plain(x), plain(s.y && s.y[i])];
        if (bounds) row.push(plain(s.low && s.low[i]), plain(s.high && s.high[i]));
        rows.push(row.join(","));
      });
    return rows.join("\r\n") + "\r\n";
  }
  function grid_csv(f) {
    const rows = [[named(f.y) + " \\ " + named(f.x)].concat(f.columns.map(String)).map(quoted).join(",")];
    const n = f.columns.length;
    f.rows.forEach((r, i) => rows.push([quoted(String(r))].concat(f.values.slice(i * n, (i + 1) * n).map(plain)).join(",")));
    return rows.join("\r\n") + "\r\n";
  }

  const increasing = (v) => v.every((a, i) => i === 0 || a >= v[i - 1]);
  const is_line = (s) => s.draw === "line" || s.draw === "steps" || s.draw === "line_and_points";

  // A series of points alone may come in any order; a line that turns back in x stays a drawing.
  function sorted(s) {
    if (increasing(s.x)) return s;
    const order = s.x.map((_, i) => i).sort((a, b) => s.x[a] - s.x[b]);
    const pick = (v) => v && order.map((i) => v[i]);
    return { ...s, x: pick(s.x), y: pick(s.y), low: pick(s.low), high: pick(s.high) };
  }

  function shape(ctx, kind, x, y, r) {
    ctx.beginPath();
    if (kind === 1) ctx.rect(x - 0.9 * r, y - 0.9 * r, 1.8 * r, 1.8 * r);
    else if (kind === 2) { ctx.moveTo(x, y - 1.2 * r); ctx.lineTo(x + 1.15 * r, y + 0.8 * r); ctx.lineTo(x - 1.15 * r, y + 0.8 * r); }
    else if (kind === 3) { ctx.moveTo(x, y - 1.3 * r); ctx.lineTo(x + 1.3 * r, y); ctx.lineTo(x, y + 1.3 * r); ctx.lineTo(x - 1.3 * r, y); }
    else ctx.arc(x, y, r, 0, 2 * Math.PI);
    ctx.fill();
  }

  // Bands below the lines, error bars and markers above, rules and words on top.
  function painter(f, series) {
    const clip = (u, draw) => {
      const c = u.ctx, b = u.bbox, m = 6 * devicePixelRatio;
      c.save();
      c.beginPath();
      c.rect(b.left - m, b.top - m, b.width + 2 * m, b.height + 2 * m);
      c.clip();
      draw(c, devicePixelRatio);
      c.restore();
    };
    const at = (u, s, i, v) => [u.valToPos(s.x[i], "x", true), u.valToPos(v, "y", true)];
    const ok = (v) => v !== null && v !== undefined;
    return {
      hooks: {
        drawAxes: [(u) => clip(u, (c, r) => {
          const zero = u.scales.y.min < 0 && u.scales.y.max > 0 && !f.y.log ? Math.round(u.valToPos(0, "y", true)) : null;
          if (zero !== null) {
            c.strokeStyle = css("--muted");
            c.lineWidth = r;
            c.beginPath();
            c.moveTo(u.bbox.left, zero);
            c.lineTo(u.bbox.left + u.bbox.width, zero);
            c.stroke();
          }
          series.forEach((s, k) => {
            if (s.draw !== "band" || !u.series[k + 1].show) return;
            c.beginPath();
            for (let i = 0; i < s.x.length; ++i) if (ok(s.high[i])) c.lineTo(...at(u, s, i, s.high[i]));
            for (let i = s.x.length - 1; i >= 0; --i) if (ok(s.low[i])) c.lineTo(...at(u, s, i, s.low[i]));
            c.closePath();
            c.globalAlpha = 0.18;
            c.fillStyle = colour(s.colour);
            c.fill();
          });
        })],
        draw: [(u) => clip(u, (c, r) => {
          series.forEach((s, k) => {
            if (s.draw === "band" || !u.series[k + 1].show) return;
            c.fillStyle = c.strokeStyle = colour(s.colour);
            c.lineWidth = 1.3 * r;
            if (s.low) {
              c.beginPath();
              for (let i = 0; i < s.x.length; ++i) {
                if (!ok(s.low[i]) || !ok(s.high[i])) continue;
                const [x, lo] = at(u, s, i, s.low[i]), hi = at(u, s, i, s.high[i])[1];
                c.moveTo(x, lo); c.lineTo(x, hi);
                for (const y of [lo, hi]) { c.moveTo(x - 4 * r, y); c.lineTo(x + 4 * r, y); }
              }
              c.stroke();
            }
            if (s.draw === "points" || s.draw === "line_and_points") {
              const size = (s.x.length > 300 ? 1.6 : 4) * r;
              for (let i = 0; i < s.x.length; ++i)
                if (ok(s.y[i])) { const [x, y] = at(u, s, i, s.y[i]); shape(c, s.colour < 0 ? 0 : (s.colour + 1) % 4, x, y, size); }
            }
          });
          c.fillStyle = c.strokeStyle = css("--muted");
          c.font = 12 * r + "px " + css("--sans");
          for (const a of f.annotations) {
            const b = u.bbox, x = ok(a.x) ? u.valToPos(a.x, "x", true) : b.left + b.width, y = ok(a.y) ? u.valToPos(a.y, "y", true) : b.top + 14 * r;
            if (ok(a.x) !== ok(a.y)) {
              c.setLineDash([3 * r, 4 * r]);
              c.lineWidth = r;
              c.beginPath();
              if (ok(a.x)) { c.moveTo(x, b.top); c.lineTo(x, b.top + b.height); } else { c.moveTo(b.left, y); c.lineTo(b.left + b.width, y); }
              c.stroke();
              c.setLineDash([]);
            }
            const left = !ok(a.x) || x + c.measureText(a.text).width + 8 * r > b.left + b.width;
            c.textAlign = left ? "right" : "left";
            c.strokeStyle = css("--card");
            c.lineWidth = 4 * r;
            c.lineJoin = "round";
            c.strokeText(a.text, x + (left ? -6 : 6) * r, y - 5 * r);
            c.strokeStyle = css("--muted");
            c.fillText(a.text, x + (left ? -6 : 6) * r, y - 5 * r);
          }
        })],
      },
    };
  }

  const charts = [];

  function build(node, f) {
    const live = node.querySelector(".live");
    const series = f.series.map(sorted);
    const width = Math.max(200, live.clientWidth), height = Math.round(Math.min(Math.max(0.6 * width, 250), f.height));
    const tables = series.map((s) => [s.x, s.draw === "band" ? s.high : s.y]);
    const same = tables.every((t) => t[0].length === tables[0][0].length && t[0].every((x, i) => x === tables[0][0][i]));
    const joined = same ? [tables[0][0], ...tables.map((t) => t[1])] : uPlot.join(tables);
    let lo = Infinity, hi = -Infinity;
    for (const s of series)
      for (const v of [s.y, s.low, s.high]) if (v) for (const a of v) if (a !== null && !(f.y.log && a <= 0)) { lo = Math.min(lo, a); hi = Math.max(hi, a); }
    for (const a of f.annotations) if (a.y !== null && a.y !== undefined) { lo = Math.min(lo, a.y); hi = Math.max(hi, a.y); }
    const y_range = () => {
      if (!(hi >= lo)) return [0, 1];
      let a = lo, b = hi;
      if (f.y.log) { const k = Math.max(1.05, (b / a) ** 0.05); return [f.y.min ?? a / k, f.y.max ?? b * k]; }
      if (b - a < 1e-12 * Math.max(Math.abs(a), Math.abs(b)) || b === a) { const h = b === 0 ? 1 : 0.1 * Math.abs(b); a -= h; b += h; }
      const m = 0.06 * (b - a);
      return [f.y.min ?? (a >= 0 && a < 0.35 * b ? 0 : a - m), f.y.max ?? b + m];
    };
    const text = { stroke: css("--muted"), font: "13px " + css("--sans"), labelFont: "13px " + css("--sans"),
                   grid: { stroke: css("--grid"), width: 1 }, ticks: { show: false } };
    const labels = (u, values) => values.map((v) => (v === null ? "" : number(v)));
    const widest = (u, values) => { const n = Math.max(0, ...(values ?? []).map((v) => v.length)); return 20 + 7.4 * n; };
    const all_x = joined[0];
    const u = new uPlot({
      width, height, plugins: [painter(f, series)],
      cursor: { sync: { key: "x:" + named(f.x), setSeries: false }, drag: { x: true, y: true, uni: 20 }, points: { size: 9 },
        // The nearest sample that this series has, within 24 pixels of the pointer.
        dataIdx: (self, k, at, x) => {
          const v = self.data[k];
          if (k === 0 || (v[at] !== null && v[at] !== undefined)) return at;
          const here = self.valToPos(x, "x");
          let best = null, near = 24;
          for (const step of [-1, 1])
            for (let i = at + step; i >= 0 && i < v.length; i += step) {
              const d = Math.abs(self.valToPos(self.data[0][i], "x") - here);
              if (d > 24) break;
              if (v[i] !== null && v[i] !== undefined) { if (d < near) { near = d; best = i; } break; }
            }
          return best;
        } },
      scales: {
        x: { time: false, distr: f.x.log ? 3 : 1, range: (self, a, b) => {
          if (a !== all_x[0] || b !== all_x[all_x.length - 1]) return a !== b ? [a, b] : [a - 0.5, b + 0.5];
          if (f.x.log) { const k = Math.max(1.02, (b / a) ** 0.03); return [f.x.min ?? a / k, f.x.max ?? b * k]; }
          const m = b > a ? 0.025 * (b - a) : 0.5;
          return [f.x.min ?? a - m, f.x.max ?? b + m]; } },
        y: { distr: f.y.log ? 3 : 1, range: (self, a, b) => (self.zoomed ? [a, b] : y_range()) },
      },
      axes: [{ ...text, label: named(f.x), labelSize: 22, size: 30, values: labels },
             { ...text, label: named(f.y), labelSize: 24, size: widest, values: labels }],
      series: [{ label: f.x.label, value: (s, v) => (v === null ? "" : number(v) + (f.x.unit ? " " + f.x.unit : "")) },
        ...series.map((s) => ({ label: s.name || f.y.label, stroke: () => colour(s.colour), width: !is_line(s) ? 0 : s.x.length > 3000 ? 1.2 : 2,
          dash: s.dashed ? [7, 5] : undefined, points: { show: false }, spanGaps: false,
          paths: s.draw === "steps" ? uPlot.paths.stepped({ align: 1 }) : is_line(s) ? undefined : () => null,
          value: (self, v) => (v === null || v === undefined ? "" : number(v) + (f.y.unit ? " " + f.y.unit : "")) }))],
      legend: { markers: { fill: (self, k) => (k === 0 ? "transparent" : colour(series[k - 1].colour)) } },
      hooks: {
        // A drag sets y itself; a double click gives the whole range back.
        setSelect: [(self) => { self.zoomed = self.select.height > 0; }],
        ready: [(self) => self.over.addEventListener("dblclick", () => { self.zoomed = false; self.setScale("y", { min: null, max: null }); })],
      },
    }, joined, live);
    return u;
  }

  function start() {
    const nodes = [...document.querySelectorAll("figure[data-figure]")];
    for (const node of nodes) {
      const f = data.figures[Number(node.dataset.figure)];
      const name = (f.title || "figure").replace(/[^\w]+/g, "-").toLowerCase();
      node.querySelector(".csv").onclick = () => save(name + ".csv", "text/csv", f.values ? grid_csv(f) : csv(f));
      node.querySelector(".svg").onclick = () => save(name + ".svg", "image/svg+xml", new XMLSerializer().serializeToString(node.querySelector(".static svg")));
      if (f.values) hover_grid(node, f);
      else if (typeof uPlot === "function" && f.series.length > 0 && f.series.every((s) => s.x.length > 0 && (!(is_line(s) || s.draw === "band") || increasing(s.x)))) {
        node.classList.add("is-live");
        charts.push({ node, f, u: null, width: 0 });
      }
    }
    for (const c of charts) {
      c.u = build(c.node, c.f);
      c.width = c.node.querySelector(".live").clientWidth;
      new ResizeObserver(() => {
        const w = c.node.querySelector(".live").clientWidth;
        if (w > 0 && Math.abs(w - c.width) > 1) { c.width = w; requestAnimationFrame(() => rebuild(c)); }
      }).observe(c.node);
    }
    for (const b of document.querySelectorAll("button[data-copy]"))
      b.onclick = () => navigator.clipboard?.writeText(b.dataset.copy).then(() => { b.textContent = "Copied"; setTimeout(() => (b.textContent = "Copy"), 1200); });
    for (const b of document.querySelectorAll("button[data-download]"))
      b.onclick = () => save(b.dataset.download, "application/octet-stream", data.downloads[Number(b.dataset.index)]);
    const root = document.documentElement, dark = matchMedia("(prefers-color-scheme: dark)");
    document.querySelector(".theme").onclick = () => {
      const now = root.dataset.theme || (dark.matches ? "dark" : "light");
      root.dataset.theme = now === "dark" ? "light" : "dark";
      charts.forEach(rebuild);
    };
    dark.addEventListener("change", () => charts.forEach(rebuild));
    root.dataset.ready = String(charts.length);
  }
  function rebuild(c) {
    const shown = c.u.series.map((s) => s.show);
    c.u.destroy();
    c.u = build(c.node, c.f);
    shown.forEach((show, k) => { if (k > 0 && !show) c.u.setSeries(k, { show }); });
  }

  function hover_grid(node, f) {
    const svg = node.querySelector("svg"), tip = document.createElement("div");
    tip.className = "tip";
    node.append(tip);
    const [left, top, right, bottom] = svg.dataset.plot.split(" ").map(Number);
    svg.addEventListener("pointermove", (e) => {
      const b = svg.getBoundingClientRect(), k = svg.viewBox.baseVal.width / b.width;
      const x = ((e.clientX - b.left) * k - left) / (right - left), y = ((e.clientY - b.top) * k - top) / (bottom - top);
      if (x < 0 || x >= 1 || y < 0 || y >= 1) { tip.style.opacity = 0; return; }
      const c = Math.floor(x * f.columns.length), r = Math.floor((f.bottom_up ? 1 - y : y) * f.rows.length);
      const v = f.values[Math.min(r, f.rows.length - 1) * f.columns.length + c];
      const word = (axis, value) => axis.label + " " + (typeof value === "number" ? number(value) : value) + (axis.unit ? " " + axis.unit : "");
      tip.textContent = word(f.x, f.columns[c]) + "\n" + word(f.y, f.rows[Math.min(r, f.rows.length - 1)]) + "\n" + word(f.value, v === null ? "–" : v);
      tip.style.opacity = 1;
      tip.style.left = Math.min(e.clientX + 14, innerWidth - tip.offsetWidth - 8) + "px";
      tip.style.top = e.clientY + 14 + "px";
    });
    svg.addEventListener("pointerleave", () => (tip.style.opacity = 0));
  }

  start();
})();
