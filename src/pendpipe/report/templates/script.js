(() => {
  const $ = (id) => document.getElementById(id), all = (q, e = document) => [...e.querySelectorAll(q)];
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
    if (i < 0) return r.textContent.toLowerCase().includes(w);
    const v = value(r, i);
    return v !== "" && (m[2] === "<" ? +v < +m[3] : +v > +m[3]);
  };
  const filter = () => {
    const words = $("filter").value.toLowerCase().split(/\s+/).filter(Boolean);
    rows.forEach((r) => { r.hidden = !words.every((w) => test(r, w)); });
    $("shown").textContent = `${rows.filter((r) => !r.hidden).length} of ${rows.length} records`;
  };
  $("filter").oninput = filter; $("filter-box").hidden = false; filter();
  const save = (name, text, type) => {
    const a = document.createElement("a");
    a.download = name; a.href = URL.createObjectURL(new Blob([text], { type })); a.click();
    setTimeout(() => URL.revokeObjectURL(a.href), 1e4);
  };
  $("csv").onclick = () => {
    const cell = (s) => (/[",\n]/.test(s) ? `"${s.replace(/"/g, '""')}"` : s);
    // A spreadsheet runs a word that begins like a formula; an apostrophe stops it.
    const word = (s) => s.replace(/^[=+\-@]/, "'$&");
    const wide = (r, f) => [...r.cells].flatMap((c, i) => (heads[i].classList.contains("n") ? f(c, i) : [word(c.textContent.trim())]));
    const lines = [wide(table.tHead.rows[0], (c) => [c.textContent.trim(), "sd of " + c.textContent.trim()])];
    rows.filter((r) => !r.hidden).forEach((r) => lines.push(wide(r, (c) => [c.dataset.v, c.dataset.s])));
    save("records.csv", lines.map((l) => l.map(cell).join(",")).join("\n") + "\n", "text/csv");
  };
  const svg = (id) => {
    const s = document.querySelector(`#${id} svg`).cloneNode(true), [, , w, h] = s.getAttribute("viewBox").split(" ");
    s.setAttribute("xmlns", "http://www.w3.org/2000/svg"); s.setAttribute("width", w); s.setAttribute("height", h);
    return new XMLSerializer().serializeToString(s);
  };
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
  addEventListener("beforeprint", () => all("details").forEach((d) => { d.open = true; }));
})();
