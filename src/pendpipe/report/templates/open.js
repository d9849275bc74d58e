"use strict";
const $ = (id) => document.getElementById(id);
const known = new Map(); // what is shown of each recording, by its number
const asked = new Map(); // the last question about each: an answer to an earlier one comes too late
let current = 0, first = null, waiting = 0, failed = "";

const field = (name) => $("form").elements.namedItem(name); // .length would be their number
const say = (text) => { $("status").textContent = text; };
const post = async (path, body) => {
  const answer = await fetch(path, { method: "POST", body });
  if (!answer.ok) throw new Error(answer.statusText);
  return answer.json();
};
const page = async (path) => new DOMParser().parseFromString(await (await fetch(path)).text(), "text/html");
const parsed = (text) => new DOMParser().parseFromString(text, "text/html");

const LEFT = 86, RIGHT = 792, WIDTH = 800;
const draw = (svg, points, low, high, begin, end) => {
  const x = (v) => LEFT + (RIGHT - LEFT) * (v - begin) / (end - begin || 1), y = (v) => 190 - 175 * (v - low) / (high - low || 1);
  const text = (v, span) => v.toFixed(Math.min(6, Math.max(0, 1 - Math.floor(Math.log10(span || 1))))).replace("-", "−");
  const at = [0, 1, 2, 3, 4].map((n) => begin + n * (end - begin) / 4), up = [0, 1, 2].map((n) => low + n * (high - low) / 2);
  svg.innerHTML = `<path class="frame" d="M${LEFT},15V190H${RIGHT}"/><path d="M${points.map(([a, b]) => `${x(a).toFixed(1)},${y(b).toFixed(1)}`).join("L")}"/>`
    + at.map((v, n) => `<text x="${x(v)}" y="208" text-anchor="${n < 4 ? "middle" : "end"}">${text(v, (end - begin) / 10)}</text>`).join("")
    + up.map((v) => `<text x="80" y="${y(v) + 4}" text-anchor="end">${text(v, high - low)}</text>`).join("");
  return x;
};

const picture = () => {
  const { picture: drawn } = known.get(current);
  $("picture").toggleAttribute("hidden", !drawn);
  if (!drawn || !drawn.points.length) return;
  const values = drawn.points.map((p) => p[1]), times = drawn.points.map((p) => p[0]);
  const begin = times[0], end = times[times.length - 1];
  const x = draw($("picture"), drawn.points, Math.min(...values), Math.max(...values), begin, end);
  $("picture").setAttribute("aria-label", `The recording (${drawn.unit || "no unit"}) against time in s`);
  const shade = (from, to) => {
    if (to > from) $("picture").insertAdjacentHTML("beforeend", `<rect x="${x(from)}" y="15" width="${x(to) - x(from)}" height="175"/>`);
  };
  const start = field("start"), stop = field("stop");
  if (start.value) shade(begin, Math.min(end, +start.value));
  if (stop.value) shade(Math.max(begin, +stop.value), end);
};

const fill = (answer) => {
  const columns = answer.columns.map(([n, name]) => [String(n), `${n}: ${name}`]);
  field("column").replaceChildren(...[["", "as the file says"], ...columns].map(([value, text]) => new Option(text, value)));
  for (const name of ["column", "unit", "length", "start", "stop"]) field(name).value = answer.options[name] || "";
  field("diagnosis").checked = Boolean(answer.options.diagnosis);
  field("every").checked = false;
};

const show = (number, focus) => {
  const answer = known.get(number);
  current = number;
  first = null;
  $("one").hidden = false;
  $("all").hidden = true;
  $("back").hidden = $("for-all").hidden = known.size < 2;
  $("save").hidden = !answer.sheet;
  $("save").href = `sheet/${number}`;
  $("save").download = `${answer.name.replace(/.*[\\/]/, "").replace(/\.[^.]*$/, "")}.html`;
  $("command").textContent = answer.command;
  fill(answer);
  picture();
  const sheet = parsed(answer.sheet || `<h1></h1><p class="refused"></p>`);
  if (!answer.sheet) {
    sheet.querySelector("h1").textContent = answer.name;
    sheet.querySelector("p").textContent = `Refused: ${answer.refusal}`;
  }
  const inside = [...sheet.querySelectorAll("body > *")].flatMap((each) => ["HEADER", "MAIN"].includes(each.tagName) ? [...each.childNodes] : [each]);
  $("sheet").replaceChildren(...inside);
  $("notes").replaceChildren(...answer.notes.map((note) => Object.assign(document.createElement("p"), { className: "note", textContent: note })));
  if (focus) $("one").focus();
};

const table = async (focus) => {
  const made = await page("class");
  const rows = made.querySelector("main");
  rows.querySelectorAll("a").forEach((a) => { a.dataset.number = a.getAttribute("href").split("/")[1]; });
  $("rows").replaceChildren(...rows.childNodes);
  $("commands").textContent = await (await fetch("commands")).json();
  $("all").hidden = false;
  $("one").hidden = true;
  if (focus) $("head").focus();
};

const progress = () => {
  const done = known.size, many = done + waiting;
  say(waiting ? `${done} of ${many} read …` : `${done} of ${many} read.${failed}`);
};

const read = async (number, options, question = {}) => {
  asked.set(number, question);
  const answer = await post(`read/${number}`, options && JSON.stringify(options));
  if (asked.get(number) === question) known.set(number, answer);
};

// As many at a time as a browser has connections left for.
const each = async (jobs, work) => {
  const left = [...jobs];
  waiting += left.length;
  progress();
  const worker = async () => {
    for (let job = left.shift(); job !== undefined; job = left.shift()) {
      try { await work(job); } catch (fault) { failed += ` ${fault.message}.`; }
      waiting -= 1;
      progress();
    }
  };
  await Promise.all([worker(), worker(), worker(), worker()]);
};

const settled = async () => {
  if (known.size === 1) show([...known.keys()][0]);
  else if (known.size) await table();
};

const take = async (files) => {
  failed = "";
  const numbers = [];
  for (const file of files) { // one by one, so that they keep their order
    say(`${file.name} is taken …`);
    const fits = file.size <= +$("main").dataset.largest;
    try {
      if (!fits) throw new Error("too large to be dropped: give its name to pendpipe open");
      numbers.push(await post(`files/${encodeURIComponent(file.name)}`, file));
    } catch (fault) { failed += ` ${file.name}: ${fault.message}.`; }
  }
  await each(numbers, (number) => read(number));
  await settled();
};

const again = async (options, every) => {
  failed = "";
  const numbers = every ? [...known.keys()] : [current], seen = current, question = {};
  say("Reading …");
  await Promise.all(numbers.map((number) => read(number, options, question).catch((fault) => { failed += ` ${fault.message}.`; })));
  if (asked.get(seen) !== question) return; // asked again, or taken out
  say(`Read again.${failed}`);
  if ($("one").hidden) await table();
  else if (numbers.includes(current)) show(current);
};

const chosen = () => {
  const options = Object.fromEntries(new FormData($("form")));
  delete options.every;
  return options;
};
const submit = () => again(chosen(), field("every").checked);

$("form").addEventListener("submit", (event) => { event.preventDefault(); submit(); });
$("form").addEventListener("input", picture);
$("reset").addEventListener("click", () => again({}, field("every").checked));
$("choose").addEventListener("change", async (event) => { const files = [...event.target.files]; event.target.value = ""; await take(files); });
$("back").addEventListener("click", () => table(true));
$("forget").addEventListener("click", async () => {
  await post(`forget/${current}`, "");
  known.delete(current);
  asked.delete(current);
  progress();
  $("one").hidden = true;
  await settled();
});
$("rows").addEventListener("click", (event) => {
  const link = event.target.closest("a[data-number]");
  if (!link) return;
  event.preventDefault();
  show(+link.dataset.number, true);
});

const time = (event) => {
  const box = $("picture").getBoundingClientRect(), times = known.get(current).picture.points.map((p) => p[0]);
  const share = ((event.clientX - box.left) / box.width * WIDTH - LEFT) / (RIGHT - LEFT);
  return times[0] + Math.min(1, Math.max(0, share)) * (times[times.length - 1] - times[0]);
};
const part = (from, to) => {
  const start = field("start"), stop = field("stop");
  [start.value, stop.value] = [from, to].sort((a, b) => a - b).map((v) => v.toPrecision(5));
  first = null;
  picture();
  submit();
};
let down = null;
$("picture").addEventListener("pointerdown", (event) => { down = [event.clientX, time(event)]; });
$("picture").addEventListener("pointerup", (event) => {
  if (!down) return;
  const [x, from] = down, to = time(event);
  down = null;
  if (Math.abs(event.clientX - x) > 8) return part(from, to);
  if (first !== null) return part(first, to);
  first = to;
  const start = field("start"), stop = field("stop");
  start.value = to.toPrecision(5);
  stop.value = "";
  picture();
  say("Now click where the part ends.");
});

for (const kind of ["dragover", "dragleave", "drop"]) {
  document.addEventListener(kind, (event) => {
    event.preventDefault();
    $("drop").classList.toggle("over", kind === "dragover");
    if (kind === "drop" && event.dataTransfer.files.length) take([...event.dataTransfer.files]);
  });
}

const clock = (s) => `${Math.floor(s / 60)} min ${String(Math.floor(s % 60)).padStart(2, "0")} s`;
const watch = async () => {
  const begun = Date.now();
  let d;
  try { d = await (await fetch("live")).json(); } catch { $("now").textContent += " The recorder has ended, or its view has."; return; }
  if (d.scans) {
    const values = d.last.map((p) => p[1]), low = Math.min(...values), high = Math.max(...values), left = Math.max(0, d.duration_s - d.elapsed_s);
    $("now").textContent = `${d.model}: ${clock(d.elapsed_s)} of ${clock(d.duration_s)}, ${clock(left)} left; ${d.scans} scans, ${d.lost} lost, ${(d.bytes / 1e6).toFixed(2)} MB`
      + (d.reason ? `; ${d.reason}` : "");
    $("done").value = Math.min(1, d.elapsed_s / d.duration_s);
    if (values.length) draw($("last"), d.last, low, high, Math.max(0, d.elapsed_s - 60), Math.max(60, d.elapsed_s));
    if (d.amplitude.length) draw($("amplitude"), d.amplitude, 0, 1.05 * Math.max(1e-9, ...d.amplitude.map((p) => p[1])), 0, d.duration_s);
  }
  setTimeout(watch, Math.max(1000, 9 * (Date.now() - begun)));
};
if ($("live")) watch();

(async () => {
  const numbers = await (await fetch("files")).json();
  if (!numbers.length) return;
  await each(numbers, (number) => read(number));
  await settled();
})();
