// The page of `camssf app`: it sends photos and orders to the local server, and shows what comes back.

const $ = (name) => document.getElementById(name);
const SVG = "http://www.w3.org/2000/svg";
const CORNERS = ["top left", "top right", "bottom right", "bottom left"];
const TEXT = /\.(json|csv|tsv|txt|cxf|cgats|ti3)$/i;
const BY_CODE = "";
const photos = [], names = [], ownCharts = new Map();
let lists, base, session = null, current = null, queue = Promise.resolve(), calibrated = false, waiting = {};

class Problem extends Error {}

// -- the server ---------------------------------------------------------------------------------------------------

const answer = async (response) => {
  if (!response.ok) {
    const found = await response.json().catch(() => null);
    if (response.status === 404 && !photos.length && !ownCharts.size) session = null; // nothing is lost: begin another
    throw new Problem(found?.error?.words ?? `camssf app answered ${response.status}. Reload the page.`);
  }
  return response;
};

/** The tab's session at the server, which is begun once. */
const begun = () => session ??= begin().catch((error) => {
  session = null;
  throw error;
});

async function begin() {
  lists = await (await call("sessions", { method: "POST" })).json();
  base = `sessions/${lists.session}`;
  $("chart").replaceChildren(...lists.charts.map(([name, words, known]) => Object.assign(
    new Option(known ? words : `${words}: add the table of yours`, name), { disabled: !known })));
  addCodes($("chart"), $("chart-code"), lists.chart_codes);
  $("chart").disabled = false;
  $("format").replaceChildren(...Object.entries(lists.exports).map(([value, words]) => new Option(words, value)));
  setTimeout(beat, 1000 * lists.beat);
  $("session").hidden = true;
  document.documentElement.dataset.ready = "yes";
}

function lost(error) {
  Object.assign($("session"), { textContent: error.message, className: "problem", hidden: false });
}

/** Tell the server again and again that the tab is alive, and the user if the server is not. */
async function beat() {
  try {
    await call(base, { method: "POST" });
    $("session").hidden = true;
  } catch (error) {
    if (!session) return;
    lost(error);
  }
  setTimeout(beat, 1000 * lists.beat);
}

async function call(path, options) {
  try {
    return await answer(await fetch(path, options));
  } catch (error) {
    if (error instanceof Problem || error.name === "AbortError") throw error;
    throw new Problem("camssf app does not answer. Start it again and open its new address.");
  }
}

/** Run a task once the ones before it have ended; returns its value. */
function task(name, order, stage) {
  const ran = queue.then(() => busy(stage, async (signal) => {
    const response = await call(`${base}/tasks/${name}`, { method: "POST", body: JSON.stringify(order),
      headers: { "Content-Type": "application/json" }, signal });
    const reader = response.body.pipeThrough(new TextDecoderStream()).getReader();
    let value = null;
    for (let rest = "", chunk = await reader.read(); !chunk.done; chunk = await reader.read()) {
      const lines = (rest + chunk.value).split("\n");
      rest = lines.pop();
      for (const line of lines.map((each) => JSON.parse(each))) {
        if (line.error) throw new Problem(line.error.words);
        value ??= line.value;
        if (line.stage) show(line.stage, line.part);
      }
    }
    if (!value) throw new Problem("The task ended without an answer. Try again.");
    return value;
  }));
  queue = ran.catch(() => {});
  return ran;
}

async function busy(stage, work) {
  current = new AbortController();
  show(stage, 0);
  try {
    return await work(current.signal);
  } catch (error) {
    throw error.name === "AbortError" ? new Problem("Cancelled.") : error;
  } finally {
    current = null;
    $("progress").hidden = true;
  }
}

function show(stage, part) {
  $("progress").hidden = false;
  $("stage").textContent = stage;
  $("part").value = part;
}

/** Run what a control starts, and put its problem into words. */
async function guarded(place, work) {
  place.textContent = "";
  try {
    return await work();
  } catch (error) {
    if (!(error instanceof Problem)) console.error(error);
    place.textContent = named(error instanceof Problem ? error.message : `${error} Reload the page.`);
  }
}

/** The text without the folders in which the server keeps the files. */
const named = (words) => words.replace(/(?:photo|layout|table)-\d+\//g, "")
  .replace(".signing-key.pem", () => $("key").files[0].name);

// -- files --------------------------------------------------------------------------------------------------------

const add = (files) => guarded($("upload-problem"), async () => {
  await begun();
  const wrong = [], small = files.filter((file) => file.size <= lists.largest);
  for (const file of files) {
    if (!small.includes(file)) wrong.push(`${file.name} is larger than ${lists.largest >> 20} MB: no RAW photo is.`);
  }
  const texts = small.filter((file) => TEXT.test(file.name));
  if (texts.length) await addChart(texts).catch((error) => wrong.push(error.message));
  for (const file of small) if (!texts.includes(file)) await addPhoto(file).catch((error) => wrong.push(error.message));
  $("files").value = $("chart-files").value = "";
  if (wrong.length) throw new Problem(wrong.join("\n"));
});

/** Send a file of a kind; returns its number. */
async function send(kind, file) {
  await file.slice(0, 1).arrayBuffer().catch(() => {
    throw new Problem(`${file.name} cannot be read: it is a folder, or was moved or changed. Choose it again.`);
  });
  const sent = queue.then(() => busy(`sending ${file.name}`, async (signal) =>
    (await call(`${base}/files/${kind}?name=${encodeURIComponent(file.name)}`, { method: "POST", body: file, signal })).json()));
  queue = sent.catch(() => {});
  const { number } = await sent;
  names[number] = file.name;
  return number;
}

async function addPhoto(file) {
  const number = await send("photo", file);
  const found = await task("find", { photo: number, chart: chosenChart() }, `reading ${file.name}`);
  photos.push(new Photo(file.name, number, found));
  update();
}

/** Add a chart of the user's own to the list: a table, and a layout if it is no ColorChecker; one may come later. */
async function addChart(files) {
  const own = waiting;
  waiting = {};
  for (const file of files) {
    const kind = /\.json$/i.test(file.name) ? "layout" : "table";
    own[kind] = await send(kind, file);
  }
  const name = ["layout", "table"].filter((kind) => own[kind]).map((kind) => names[own[kind]]).join(", ");
  if (!own.layout || !own.table) waiting = own;
  if (!own.table) throw new Problem(`${name} is the layout of a chart. Now add the table of its patches' reflectances (CSV, CGATS or CxF).`);
  const found = await task("chart", { chart: own }, "reading the chart");
  waiting = {};
  ownCharts.set(name, own);
  [...$("chart").options].find((option) => option.value === name)?.remove();
  $("chart").add(new Option(`${name} (${found.layout}, ${found.patches} patches)`, name));
  $("chart").value = name;
  findAgain();
}

const chosen = (select, codes) => select.value === BY_CODE ? codes.value : select.value;

const chosenChart = () => ownCharts.get($("chart").value) ?? chosen($("chart"), $("chart-code"));

/** Search all photos for the chart, except those whose corners were moved by hand. */
const findAgain = () => photos.filter((photo) => !photo.moved).forEach((photo) => guarded(photo.problem, async () =>
  photo.place(await task("find", { photo: photo.number, chart: chosenChart() }, "looking for the chart"))));

// -- photos -------------------------------------------------------------------------------------------------------

function update() {
  $("calibrate").disabled = !photos.some((photo) => photo.role.value === "chart");
}

class Photo {
  constructor(name, number, found) {
    Object.assign(this, { name, number });
    this.card = $("card").content.firstElementChild.cloneNode(true);
    const part = (selector) => this.card.querySelector(selector);
    Object.assign(this, { svg: part("svg"), frame: part("svg g"), outline: part(".outline"), problem: part(".problem"),
      role: part(".role"), lamp: part(".lamp"), lampCode: part(".lamp-code"), side: part(".span"), reflectance: part(".reflectance") });
    part("h3").textContent = name;
    part(".camera").textContent = `${found.camera || "unnamed camera"}, ${found.width} × ${found.height} px`;
    this.lamp.add(new Option("", "auto"));
    for (const [heading, lamps] of lists.lamps) if (heading !== lists.codes) {
      const group = document.createElement("optgroup");
      group.label = heading;
      group.append(...lamps.map(([lamp, words]) => new Option(words, lamp)));
      this.lamp.add(group);
    }
    addCodes(this.lamp, this.lampCode, lists.lamps.find(([heading]) => heading === lists.codes)[1].map(([lamp]) => lamp));
    this.draw(found);
    this.place(found);
    this.side.value = 2 * Math.round(Math.max(24, found.width / 80) / 2);
    this.side.addEventListener("change", () => this.refresh());
    this.role.addEventListener("change", () => { this.problem.textContent = ""; this.refresh(); update(); });
    part(".read").addEventListener("click", () => this.read());
    part(".remove").addEventListener("click", () => { photos.splice(photos.indexOf(this), 1); this.card.remove(); update(); });
    $("photos").append(this.card);
  }

  /** The preview, upright; marks are placed in pixels of the sensor. */
  draw({ width, height, orientation, preview }) {
    Object.assign(this, { width, height });
    const turned = orientation === 6 || orientation === 8;
    const turns = { 3: `translate(${width} ${height}) rotate(180)`, 6: `translate(${height} 0) rotate(90)`,
      8: `translate(0 ${width}) rotate(-90)` };
    this.svg.setAttribute("viewBox", turned ? `0 0 ${height} ${width}` : `0 0 ${width} ${height}`);
    this.svg.setAttribute("aria-label", `Photo ${this.number}, with the chart's outline`);
    this.frame.setAttribute("transform", turns[orientation] ?? "");
    const image = this.frame.querySelector("image");
    for (const [key, value] of Object.entries({ href: `${base}/files/${preview}`, width, height })) image.setAttribute(key, value);
    image.addEventListener("pointerdown", (event) => { this.region.at = this.point(event); this.region.shown = true; this.read(); });
    const angle = { 3: 180, 6: -90, 8: 90 }[orientation] ?? 0;
    this.marks = CORNERS.map((which) => this.mark("corner", `Corner of the chart, ${which}`, "circle", "", angle));
    this.white = this.mark("white", "White or grey reference", "rect", "W", angle);
    this.region = this.mark("region", "Region to read; Enter reads it", "rect", "", angle);
    this.region.g.addEventListener("keydown", (event) => { if (event.key === "Enter") this.read(); });
  }

  /** Put outline and white reference where the chart was found, else in the middle. */
  place(found) {
    const { width: w, height: h } = this;
    const middle = [[0.3, 0.35], [0.7, 0.35], [0.7, 0.65], [0.3, 0.65]].map(([x, y]) => [x * w, y * h]);
    (found.corners ?? middle).forEach((corner, i) => { this.marks[i].at = corner; this.marks[i].shown = true; });
    const [x, y, side] = found.white ?? [0.15 * w, 0.5 * h, w / 40];
    Object.assign(this.white, { at: [x + side / 2, y + side / 2], side, shown: true });
    if (found.reflectance) this.reflectance.value = found.reflectance;
    this.moved = false;
    this.problem.textContent = found.problem
      ? `${named(found.problem.words)} Or drag the four corners here, or choose another use for this photo.` : "";
    this.refresh();
  }

  mark(kind, label, shape, letter, angle) {
    const g = document.createElementNS(SVG, "g"), form = document.createElementNS(SVG, shape);
    g.append(form);
    g.setAttribute("class", `handle ${kind}`);
    g.setAttribute("role", "button");
    g.setAttribute("tabindex", "0");
    const mark = { g, form, label, letter, at: [this.width / 2, this.height / 2], shown: false, angle };
    if (letter) {
      const text = document.createElementNS(SVG, "text");
      text.textContent = letter;
      text.setAttribute("font-size", this.width / 40);
      g.append(text);
    }
    const moved = (to) => {
      mark.at = [Math.min(Math.max(to[0], 0), this.width - 1), Math.min(Math.max(to[1], 0), this.height - 1)];
      if (kind === "corner") this.moved = true;
      this.refresh();
    };
    g.addEventListener("pointerdown", (event) => { g.setPointerCapture(event.pointerId); g.focus(); event.preventDefault(); });
    g.addEventListener("pointermove", (event) => { if (g.hasPointerCapture(event.pointerId)) moved(this.point(event)); });
    g.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
      if (!step) return;
      event.preventDefault();
      const inverse = this.frame.getScreenCTM().inverse(), [dx, dy] = step.map((each) => each * (event.shiftKey ? 10 : 1));
      moved([mark.at[0] + inverse.a * dx + inverse.c * dy, mark.at[1] + inverse.b * dx + inverse.d * dy]);
    });
    this.frame.append(g);
    return mark;
  }

  point(event) {
    const { x, y } = new DOMPoint(event.clientX, event.clientY).matrixTransform(this.frame.getScreenCTM().inverse());
    return [x, y];
  }

  /** Draw marks and outline where they are now; the chart's only on photos of the chart. */
  refresh() {
    const chart = this.role.value === "chart";
    this.lamp.options[0].text = chart ? "I do not know (phones only)" : "I do not know";
    this.region.side = Number(this.side.value);
    for (const mark of [...this.marks, this.white, this.region]) {
      const [x, y] = mark.at, { form, side = 0 } = mark;
      mark.g.style.display = mark.shown && (chart || mark.form.tagName === "rect") ? "" : "none";
      mark.g.setAttribute("aria-label", `${mark.label}, at ${Math.round(x)}, ${Math.round(y)}; arrow keys move it`);
      const shape = side ? { x: x - side / 2, y: y - side / 2, width: side, height: side } : { cx: x, cy: y, r: this.width / 90 };
      for (const [key, value] of Object.entries(shape)) form.setAttribute(key, value);
      const text = mark.g.querySelector("text");
      text?.setAttribute("transform", `translate(${x} ${y}) rotate(${mark.angle}) translate(${side * 0.6} 0)`);
    }
    this.outline.setAttribute("points", this.marks.map((mark) => mark.at.join(",")).join(" "));
    this.outline.style.display = chart ? "" : "none";
  }

  read() {
    this.region.shown = true;
    this.refresh();
    const output = this.card.querySelector(".colour"), picture = this.card.querySelector(".spectrum");
    picture.hidden = true;
    return guarded(this.problem, async () => {
      output.textContent = "";
      if (!calibrated) throw new Problem("A colour needs the camera's curves. Press Calibrate first, then click the photo.");
      for (const input of [this.reflectance, this.side]) if (!input.checkValidity()) {
        throw new Problem(`${input.parentElement.textContent.trim()}: ${input.validationMessage}`);
      }
      const square = ({ at: [x, y], side }) => [x - side / 2, y - side / 2, side, side];
      const found = await task("colour", { photo: this.number, lamp: chosen(this.lamp, this.lampCode), region: square(this.region),
        white: square(this.white), reflectance: Number(this.reflectance.value) }, "reading the colour");
      const words = ["L*", "a*", "b*"].map((name, i) => `${name} ${found.lab[i].toFixed(1)} ± ${(1.96 * found.lab_std[i]).toFixed(1)}`);
      const swatch = document.createElementNS(SVG, "svg"), fill = document.createElementNS(SVG, "rect");
      swatch.setAttribute("class", "swatch");
      swatch.setAttribute("aria-hidden", "true");
      for (const [key, value] of Object.entries({ width: "100%", height: "100%", fill: found.srgb })) fill.setAttribute(key, value);
      swatch.append(fill);
      output.replaceChildren(swatch, `${words.join(", ")} (95 %; CIE 1931 2°, adapted to D65).`
        + (found.light ? ` ${found.light[0].toUpperCase()}${found.light.slice(1)}.` : "")
        + (found.far ? " No measured surface explains the signals: the spectrum does not hold." : ""));
      picture.src = `${base}/files/${found.spectrum}?${Date.now()}`;
      picture.alt = `Reflectance spectrum of the region with its 95 % band; ${words.join(", ")}`;
      picture.hidden = false;
    });
  }
}

// -- calibrate, export, sign --------------------------------------------------------------------------------------

const calibrate = () => guarded($("problem"), async () => {
  const of = (role) => photos.filter((photo) => photo.role.value === role), [whites, darks] = [of("white"), of("dark")];
  const charts = of("chart");
  for (const [frames, word] of [[whites, "white"], [darks, "dark"]]) {
    if (frames.length > charts.length) throw new Problem(`There are more ${word} frames than photos of the chart. Remove one.`);
  }
  const shots = charts.map((photo, i) => ({ photo: photo.number, lamp: chosen(photo.lamp, photo.lampCode),
    corners: photo.moved ? photo.marks.map((mark) => mark.at) : null,
    white: whites[i]?.number ?? null, dark: darks[i]?.number ?? null }));
  calibrated = false;
  $("result").hidden = $("calibrate").disabled = true;
  const found = await task("calibrate", { shots, chart: chosenChart() }, "starting").finally(update);
  calibrated = found.status !== "refused";
  $("status").textContent = found.status;
  $("reasons").replaceChildren(...found.reasons.map((reason) => Object.assign(document.createElement("li"), { textContent: named(reason) })));
  $("report").src = `${base}/files/report.html?${Date.now()}`;
  $("downloads").replaceChildren(...found.files.map(link));
  $("curves").hidden = !calibrated;
  $("exported").textContent = $("signed").textContent = "";
  $("result").hidden = false;
  $("result-title").focus();
});

const link = (name) => Object.assign(document.createElement("a"), { href: `${base}/files/${name}?save`, download: name, textContent: name });

const exported = () => guarded($("export-problem"), async () => {
  const { file } = await task("export", { to: $("format").value }, "exporting");
  $("exported").replaceChildren("Save ", link(file));
});

const sign = () => guarded($("export-problem"), async () => {
  const [file] = $("key").files;
  if (!file) throw new Problem("A passport needs your private key. Choose its file, or make a pair of keys first.");
  const { file: name } = await task("passport", { key: await file.text(), passphrase: $("passphrase").value,
    serial: $("serial").value, photos: photos.filter((photo) => photo.role.value === "chart").map((photo) => photo.number) }, "signing");
  $("signed").replaceChildren("Save ", link(name));
});

const makeKey = () => guarded($("export-problem"), async () => {
  const { files } = await task("key", { passphrase: $("passphrase").value }, "making keys");
  $("signed").replaceChildren("Save both, then choose the private key: ", ...files.map(link));
});

// -- the start ----------------------------------------------------------------------------------------------------

/** Add "by its code" to a menu; once chosen, the menu of codes beside it is shown. */
function addCodes(select, codes, names) {
  codes.replaceChildren(...names.map((name) => new Option(name)));
  select.add(new Option("by its code …", BY_CODE));
  select.onchange = () => { codes.parentElement.hidden = select.value !== BY_CODE; };
}

const accept = (files) => { $("drop").classList.remove("over"); return add([...files]); };

for (const [name, work] of Object.entries({ calibrate, export: exported, sign, "make-key": makeKey, cancel: () => current?.abort() })) {
  $(name).addEventListener("click", work);
}
for (const name of ["files", "chart-files"]) {
  $(name).addEventListener("change", (event) => accept(event.target.files));
  $(name).disabled = false;
}
addEventListener("dragover", (event) => { event.preventDefault(); $("drop").classList.add("over"); });
addEventListener("dragleave", () => $("drop").classList.remove("over"));
addEventListener("drop", (event) => { event.preventDefault(); accept(event.dataTransfer.files); });
addEventListener("pagehide", () => base && fetch(base, { method: "DELETE", keepalive: true }));
addEventListener("beforeunload", (event) => { if (photos.length) event.preventDefault(); }); // the browser asks
addEventListener("pageshow", (event) => { if (event.persisted) location.reload(); });

for (const menu of [$("chart"), $("chart-code")]) menu.addEventListener("change", findAgain);
begun().catch(lost);
