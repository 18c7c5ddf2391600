// Colours and fonts of drawings, from the variables of the style sheet: light or dark.

export function lookOf(element) {
  const style = getComputedStyle(element);
  const value = (name) => style.getPropertyValue(`--${name}`).trim();
  const names = ["paper", "ink", "grid", "soft", "water"];
  return {
    ...Object.fromEntries(names.map((name) => [name, value(name)])),
    surface: value("line-1"),
    of: (receiver) => value(receiver.colour),
    font: (size, bold = false) => `${bold ? "600 " : ""}${size}px ${style.fontFamily}`,
  };
}
