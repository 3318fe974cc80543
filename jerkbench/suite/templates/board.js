"use strict";
const table = document.getElementById("board");
const body = table.tBodies[0];

function value(row, column) {
  const cell = row.cells[column];
  return cell.dataset.value === undefined ? cell.textContent : Number(cell.dataset.value);
}

function sort(header) {
  const ascending = header.getAttribute("aria-sort") !== "ascending";
  for (const other of table.tHead.rows[0].cells) other.removeAttribute("aria-sort");
  header.setAttribute("aria-sort", ascending ? "ascending" : "descending");
  const rows = [...body.rows].sort((a, b) => {
    const [x, y] = [value(a, header.cellIndex), value(b, header.cellIndex)];
    return x === y ? 0 : (x < y ? -1 : 1) * (ascending ? 1 : -1);
  });
  body.append(...rows);
}

for (const header of table.tHead.rows[0].cells) header.firstElementChild.addEventListener("click", () => sort(header));
