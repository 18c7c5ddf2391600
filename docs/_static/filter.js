// A field above a long page of reference shows only the rows and definitions that have its words.
addEventListener("DOMContentLoaded", () => {
  const entry = ":is(table.docutils tbody tr, dl.py)";
  const entries = [...document.querySelectorAll(`article ${entry}`)];
  if (!location.pathname.includes("/reference/") || entries.length < 30) return;
  const field = Object.assign(document.createElement("input"), {
    type: "search", className: "filter", placeholder: "Show entries with …",
    ariaLabel: "Show only entries with these words",
  });
  document.querySelector("article h1").after(field);
  const parts = [...document.querySelectorAll("article section section")].filter(e => e.querySelector(entry));
  field.addEventListener("input", () => {
    const words = field.value.toLowerCase().split(/\s+/).filter(Boolean);
    const has = e => words.every(word => e?.textContent.toLowerCase().includes(word));
    // What a definition holds is shown with it if its own name is what was looked for.
    const within = e => e && (has(e.querySelector("dt .descname")) || within(e.parentElement.closest("dl.py")));
    entries.forEach(e => { e.hidden = !has(e) && !within(e.matches("dl") ? e : null); });
    parts.forEach(part => {
      part.hidden = words.length > 0 && !part.querySelector(`${entry}:not([hidden])`);
    });
  });
});
