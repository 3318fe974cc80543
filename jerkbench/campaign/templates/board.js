"use strict";
const table = document.getElementById("board");
const body = table.tBodies[0];

function value(row, column) {
  const text = row.cells[column].textContent;
  const number = text.match(/^[\d.]+|[\d.]+$/);
  return table.tHead.rows[0].cells[column].textContent.trim() === "entry" || !number ? text : Number(number[0]);
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
