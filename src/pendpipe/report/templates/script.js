(() => {
  const $ = (id) => document.getElementById(id), all = (q, e = document) => [...e.querySelectorAll(q)];
  const save = (name, text, type) => {
    const a = document.createElement("a");
    a.download = name; a.href = URL.createObjectURL(new Blob([text], { type })); a.click();
    setTimeout(() => URL.revokeObjectURL(a.href), 1e4);
  };
  if ($("table")) {
    const table = $("table"), body = table.tBodies[0], rows = [...body.rows], heads = [...table.tHead.rows[0].cells];
    const key = (c) => c.firstChild.textContent.trim().replace(/\s+/g, "-").toLowerCase();
    const names = heads.map(key), value = (r, i) => r.cells[i].dataset.v ?? r.cells[i].textContent.trim();
    heads.forEach((h, i) => {
      const b = document.createElement("button");
      b.type = "button"; b.append(...h.childNodes); h.append(b);
      b.onclick = () => {
        const up = h.ariaSort !== "ascending";
        heads.forEach((o) => o.removeAttribute("aria-sort"));
        h.setAttribute("aria-sort", up ? "ascending" : "descending");
        rows.sort((p, q) => {
          const x = value(p, i), y = value(q, i);
          if (x === "" || y === "") return (x === "") - (y === "");
          return (up ? 1 : -1) * (x - y || x.localeCompare(y));
        });
        body.append(...rows);
      };
    });
    const test = (r, w) => {
      const m = /^([^<>]+)([<>])([-+.\de]+)$/.exec(w), i = m ? names.indexOf(m[1]) : -1;
      if (i < 0) return !m && r.textContent.toLowerCase().includes(w);
      const v = value(r, i);
      return v !== "" && (m[2] === "<" ? +v < +m[3] : +v > +m[3]);
    };
    const filter = () => {
      const words = $("filter").value.toLowerCase().split(/\s+/).filter(Boolean);
      rows.forEach((r) => { r.hidden = !words.every((w) => test(r, w)); });
      const lost = words.map((w) => (/^(.+?)[<>]/.exec(w) || [])[1]).filter((n) => n && !names.includes(n));
      const never = words.filter((w) => !/[<>]/.test(w) && !rows.some((r) => test(r, w)));
      $("shown").textContent = `${rows.filter((r) => !r.hidden).length} of ${rows.length} records`
        + (lost.length ? `. No column is called ${lost.join(", ")}; there are ${names.filter((_, i) => heads[i].classList.contains("n")).join(", ")}` : "")
        + (never.length ? `. No row holds ${never.join(", ")}` : "");
    };
    $("filter").oninput = filter; $("filter-box").hidden = false; filter();
    $("csv").onclick = () => {
      const cell = (s) => (/[",\n]/.test(s) ? `"${s.replace(/"/g, '""')}"` : s);
      // A spreadsheet runs a word that begins like a formula; an apostrophe stops it.
      const word = (s) => s.replace(/(^|[,;\t\n])(?=[ ']*[=+\-@\uff1d\uff0b\uff0d\uff20])/g, "$1'");
      const wide = (r, f) => [...r.cells].flatMap((c, i) => (heads[i].classList.contains("n") ? f(c, i) : [word(c.textContent.trim())]));
      const lines = [wide(table.tHead.rows[0], (c) => [c.textContent.trim(), "sd of " + c.textContent.trim()])];
      rows.filter((r) => !r.hidden).forEach((r) => lines.push(wide(r, (c) => [c.dataset.v, c.dataset.s])));
      save("records.csv", lines.map((l) => l.map(cell).join(",")).join("\n") + "\n", "text/csv");
    };
  }
  const svg = (id) => {
    const s = document.querySelector(`#${id} svg`).cloneNode(true), [, , w, h] = s.getAttribute("viewBox").split(" ");
    s.setAttribute("xmlns", "http://www.w3.org/2000/svg"); s.setAttribute("width", w); s.setAttribute("height", h);
    return new XMLSerializer().serializeToString(s);
  };
  // A waveform is drawn anew from its readings, between the times a and b.
  const unpack = async (text, Kind) => {
    const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
    const v = new Kind(await new Response(stream).arrayBuffer());
    for (let k = 0; k < 2; k++) for (let i = 1; i < v.length; i++) v[i] += v[i - 1];
    return v;
  };
  const ticks = (lo, hi) => {
    const p = 10 ** Math.floor(Math.log10((hi - lo) / 5)), s = [1, 2, 5, 10].map((k) => k * p).find((k) => (hi - lo) / k < 7), t = [];
    for (let n = Math.ceil(lo / s); n * s <= hi; n++) t.push(n * s);
    return t;
  };
  const write = (v) => String(+v.toPrecision(8)).replace("-", "−");
  all("[data-view]").forEach((f) => {
    const [low, high, bottom, top] = f.dataset.view.split(" ").map(Number), plot = f.querySelector(".plot"), inner = plot.parentNode;
    const xs = f.querySelector(".x"), ys = f.querySelector(".y"), whole = [plot, xs, ys].map((e) => e.innerHTML), d = f.dataset;
    let a = low, b = high, data, todo = Promise.resolve();
    const read = async () => {
      if (data) return;
      const [t, c] = await Promise.all([unpack(d.times, Int32Array), unpack(d.counts, Int16Array)]);
      data = { t: Float64Array.from(t, (n) => +d.begin + d.tick * n), y: Float64Array.from(c, (n) => +d.origin + d.step * n) };
    };
    const from = (time) => {
      let i = 0, j = data.t.length;
      while (i < j) { const m = (i + j) >> 1; if (data.t[m] < time) i = m + 1; else j = m; }
      return i;
    };
    const ends = () => [Math.max(0, from(a) - 1), Math.min(data.t.length, from(b) + 1)];
    const draw = () => {
      if (a <= low && b >= high) { [plot, xs, ys].forEach((e, k) => { e.innerHTML = whole[k]; }); return; }
      const [i, j] = ends(), part = data.y.subarray(i, j), least = part.reduce((p, q) => Math.min(p, q)), most = part.reduce((p, q) => Math.max(p, q));
      const pad = 0.05 * (most - least) || 1, lo = least - pad, hi = most + pad;
      const x = (v) => 54 + 578 * (v - a) / (b - a), y = (v) => 150 - 128 * (v - lo) / (hi - lo), gap = 5 * (high - low) / data.t.length, path = [];
      for (let k = i, n; k < j; k = n) {
        const at = Math.round(x(data.t[k])), pen = k > i && data.t[k] - data.t[k - 1] < gap ? "L" : "M";
        let p = k, q = k;
        for (n = k + 1; n < j && j - i > 2000 && Math.round(x(data.t[n])) === at; n++) { if (data.y[n] < data.y[p]) p = n; if (data.y[n] > data.y[q]) q = n; }
        [...new Set([k, Math.min(p, q), Math.max(p, q), n - 1])].forEach((m, c) => path.push(`${c ? "L" : pen}${x(data.t[m]).toFixed(1)},${y(data.y[m]).toFixed(1)}`));
      }
      // The fitted law, drawn for the whole, goes to its place by a matrix.
      const sx = (high - low) / (b - a), sy = (top - bottom) / (hi - lo), tx = x(low) - 54 * sx, ty = y(bottom) - 150 * sy;
      plot.innerHTML = `<path fill="none" stroke="#3f93cf" d="${path.join("")}"/><g transform="matrix(${sx} 0 0 ${sy} ${tx} ${ty})">${whole[0].replace(/<path class="(band|thin)"[^>]*><\/path>/, "")}</g>`;
      xs.innerHTML = ticks(a, b).map((v) => `<text x="${x(v)}" y="167">${write(v)}</text>`).join("");
      ys.innerHTML = ticks(lo, hi).map((v) => `<text x="48" y="${y(v) + 4}">${write(v)}</text>`).join("");
    };
    const go = (p, q) => { todo = todo.then(read).then(() => {
      const wide = Math.min(high - low, Math.max(q() - p(), 8 * (high - low) / data.t.length)), start = Math.min(Math.max(p(), low), high - wide);
      [a, b] = [start, start + wide]; draw(); f.dataset.shown = `${a} ${b}`;
    }); };
    const zoom = (k) => go(() => (a + b) / 2 - k * (b - a) / 2, () => (a + b) / 2 + k * (b - a) / 2), move = (k) => go(() => a + k * (b - a), () => b + k * (b - a));
    const acts = { "+": () => zoom(0.5), "-": () => zoom(2), ArrowLeft: () => move(-0.25), ArrowRight: () => move(0.25), 0: () => go(() => low, () => high) };
    acts["="] = acts["+"]; acts["−"] = acts["-"];
    f.tabIndex = 0; f.setAttribute("role", "group"); f.setAttribute("aria-label", `${d.name}; + and − zoom, arrows move, 0 shows all`);
    f.onkeydown = (e) => { if (acts[e.key] && !e.ctrlKey && !e.metaKey) { e.preventDefault(); acts[e.key](); } };
    [["+", "Zoom in"], ["-", "Zoom out"], ["ArrowLeft", "Earlier"], ["ArrowRight", "Later"], [0, "All"]].forEach(([k, name], n) => {
      const button = document.createElement("button");
      button.type = "button"; button.textContent = ["+", "−", "◀", "▶", "All"][n]; button.ariaLabel = name; button.onclick = acts[k];
      f.querySelector(".zooms").append(button, " ");
    });
    const time = (e) => { const r = inner.getBoundingClientRect(); return a + (b - a) * (e.clientX - r.left) / r.width; };
    let held;
    inner.onpointerdown = (e) => { held = time(e); inner.setPointerCapture(e.pointerId); };
    inner.onpointerup = (e) => { const p = Math.min(held, time(e)), q = Math.max(held, time(e)); if (q - p > (b - a) / 100) go(() => p, () => q); };
    inner.ondblclick = acts[0];
    f.table = async () => {
      await todo; await read();
      const [i, j] = [from(a), from(b)], words = all("svg > text", f).map((e) => e.textContent), lines = [words.join(",")];
      for (let k = i; k < j; k++) lines.push(`${+data.t[k].toPrecision(10)},${+data.y[k].toPrecision(8)}`);
      return lines.join("\n") + "\n";
    };
  });
  all("[data-table]").forEach((b) => { b.onclick = async () => { const f = $(b.dataset.table); save((f.dataset.name || f.id) + ".csv", f.table ? await f.table() : f.dataset.csv, "text/csv"); }; });
  all(".tools").forEach((p) => { p.hidden = false; });
  all("[data-save]").forEach((b) => { b.onclick = () => save(b.dataset.save + ".svg", svg(b.dataset.save), "image/svg+xml"); });
  all("[data-copy]").forEach((b) => {
    b.onclick = () => {
      const image = new Image(), say = (t) => { b.textContent = t; };
      image.onload = () => {
        const c = document.createElement("canvas");
        c.width = 3 * image.width; c.height = 3 * image.height;
        c.getContext("2d").drawImage(image, 0, 0, c.width, c.height);
        c.toBlob((blob) => navigator.clipboard.write([new ClipboardItem({ "image/png": blob })])
          .then(() => say("Copied"), () => say("The browser refuses: save the SVG")));
      };
      image.src = "data:image/svg+xml," + encodeURIComponent(svg(b.dataset.copy));
    };
  });
  const reveal = () => { const t = $(location.hash.slice(1)), d = t && t.closest("details"); if (d) { d.open = true; t.scrollIntoView(); } };
  addEventListener("hashchange", reveal); reveal();
  let shut = [];
  addEventListener("beforeprint", () => { shut = all("details:not([open])"); shut.forEach((d) => { d.open = true; }); });
  addEventListener("afterprint", () => shut.forEach((d) => { d.open = false; }));
})();
