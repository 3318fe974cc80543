"use strict";
const table = document.getElementById("cells");
const body = table.tBodies[0];
const shown = document.getElementById("shown");

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
    if (x === Infinity || y === Infinity) return x === Infinity ? 1 : -1; // what has no number comes last both ways
    return (x < y ? -1 : 1) * (ascending ? 1 : -1);
  });
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
  shown.textContent = `${count} of ${body.rows.length} cells`;
}

function open(key) {
  const dialog = document.getElementById("cell");
  const content = document.getElementById("content");
  content.replaceChildren(document.getElementById(`cell-${key}`).content.cloneNode(true));
  dialog.showModal();
}

for (const header of table.tHead.rows[0].cells) {
  const button = header.querySelector("button");
  if (button) button.addEventListener("click", () => sort(header));
}
document.getElementById("words").addEventListener("input", filter);
for (const one of document.querySelectorAll("select[data-column]")) one.addEventListener("change", filter);
body.addEventListener("click", (event) => {
  const button = event.target.closest("button[data-key]");
  if (button) open(button.dataset.key);
});
filter();
