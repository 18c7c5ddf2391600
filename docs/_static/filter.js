// A field above the tables of a page of reference shows only the rows that have its words.
addEventListener("DOMContentLoaded", () => {
  const rows = [...document.querySelectorAll("article table.docutils tbody tr")];
  const first = document.querySelector("article .table-wrapper");
  if (!/\/reference\/(scenario|commands|tables|results)\.html$/.test(location.pathname) || !first) return;
  const field = Object.assign(document.createElement("input"), {
    type: "search", className: "filter", placeholder: "Show rows with …",
    ariaLabel: "Show only rows with these words",
  });
  const section = document.querySelector("article h1");
  section.after(field);
  const parts = [...document.querySelectorAll("article section section")].filter(e => e.querySelector("table"));
  field.addEventListener("input", () => {
    const words = field.value.toLowerCase().split(/\s+/).filter(Boolean);
    const has = row => words.every(word => row.textContent.toLowerCase().includes(word));
    rows.forEach(row => { row.hidden = !has(row); });
    parts.forEach(part => {
      part.hidden = words.length > 0 && !part.querySelector("tbody tr:not([hidden])");
    });
  });
});
