"use strict";
const table = document.getElementById("cells");
const body = table.tBodies[0];
let details = null;
const unpacking = unpacked("cells-data").then((content) => {
  details = content;
});

async function unpacked(id) {
  const bytes = Uint8Array.from(atob(document.getElementById(id).textContent), (letter) => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return JSON.parse(await new Response(stream).text());
}

function value(row, column) {
  const cell = row.cells[column];
  const number = cell.dataset.value;
  if (number === undefined) return cell.textContent;
  return number === "" ? Infinity : Number(number);
}

function sort(header) {
  const column = header.cellIndex;
  const ascending = header.getAttribute("aria-sort") !== "ascending";
  for (const other of table.tHead.rows[0].cells) other.removeAttribute("aria-sort");
  header.setAttribute("aria-sort", ascending ? "ascending" : "descending");
  const rows = [...body.rows];
  rows.sort((a, b) => {
    const [x, y] = [value(a, column), value(b, column)];
    if (x === y) return 0;
    if (x === Infinity || y === Infinity) return x === Infinity ? 1 : -1; // rows without a number are last in both directions
    return (x < y ? -1 : 1) * (ascending ? 1 : -1);
  });
  table.classList.add("sorted"); // hides the rules between groups
  body.append(...rows);
}

function filter() {
  const words = document.getElementById("words").value.toLowerCase().split(/\s+/).filter(Boolean);
  const chosen = [...document.querySelectorAll("select[data-column]")].filter((one) => one.value !== "");
  let count = 0;
  for (const row of body.rows) {
    const text = row.textContent.toLowerCase();
    const fits = words.every((word) => text.includes(word))
      && chosen.every((one) => row.cells[Number(one.dataset.column)].textContent === one.value);
    row.hidden = !fits;
    count += fits ? 1 : 0;
  }
  document.getElementById("shown").textContent = `${count} of ${body.rows.length} combinations`;
}

function element(name, text, ...children) {
  const made = document.createElement(name);
  if (text !== null) made.textContent = text;
  made.append(...children);
  return made;
}

function grid(heads, rows) {
  const head = element("tr", null, ...heads.map((text) => Object.assign(element("th", text), { scope: "col" })));
  const lines = rows.map((row) => element("tr", null, ...row.map((text) => element("td", text))));
  const made = element("table", null, element("thead", null, head), element("tbody", null, ...lines));
  const box = element("div", null, made);
  Object.assign(box, { className: "scroll", tabIndex: 0 });
  return box;
}

function fold(summary, ...children) {
  return element("details", null, element("summary", summary), ...children);
}

function content(key) {
  const cell = details.cells[key];
  const again = element("p", `Combination ${key}. Run it again with: jerkbench rerun FOLDER ${key}`);
  again.className = "muted";
  return [
    grid(["metric", "median", "lowest", "highest"], cell.metrics),
    fold(`Each run (${cell.runs.length})`, grid(["run", "status", "reason", ...details.seeds], cell.runs)),
    fold("Configuration (JSON)", element("pre", JSON.stringify(cell.record, null, 1))),
    again,
  ];
}

function open(key) {
  const labels = details.cells[key].labels;
  document.getElementById("cell-title").textContent = labels.map(([name, value]) => `${name} ${value}`).join(", ");
  document.getElementById("content").replaceChildren(...content(key));
  document.getElementById("cell").showModal();
  document.dispatchEvent(new CustomEvent("cell", { detail: key }));
}

for (const header of table.tHead.rows[0].cells) {
  const button = header.querySelector("button");
  if (button) button.addEventListener("click", () => sort(header));
}
document.getElementById("words").addEventListener("input", filter);
for (const one of document.querySelectorAll("select[data-column]")) one.addEventListener("change", filter);
body.addEventListener("click", (event) => {
  const button = event.target.closest("button[data-key]");
  if (button && details) open(button.dataset.key);
  else if (button) unpacking.then(() => open(button.dataset.key));
});
window.addEventListener("beforeprint", () => {
  for (const one of document.querySelectorAll("#section-figures details, #section-findings details")) one.open = true;
});
filter();
