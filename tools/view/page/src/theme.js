// Light or dark: the preference of the system, or the user's choice, which the browser keeps.

const KEPT = "motorium-theme";
const preference = matchMedia("(prefers-color-scheme: dark)");
const listeners = new Set();
const canvas = document.createElement("canvas").getContext("2d");

const kept = () => {
  try {
    return localStorage.getItem(KEPT);
  } catch {
    return null; // the browser stores nothing for this page
  }
};

let choice = kept();

/** True if the page is dark. */
export const isDark = () => (choice ? choice === "dark" : preference.matches);

function apply() {
  document.documentElement.style.colorScheme = isDark() ? "dark" : "light";
  for (const listener of listeners) listener();
}

/** Changes between light and dark. A choice equal to the system's preference follows the system again. */
export function toggleTheme() {
  choice = isDark() ? "light" : "dark";
  if ((choice === "dark") === preference.matches) choice = null;
  try {
    if (choice) localStorage.setItem(KEPT, choice);
    else localStorage.removeItem(KEPT);
  } catch {
    // the choice lasts as long as the page
  }
  apply();
}

/** The value of a colour of the style sheet, such as `--line`, as `#rrggbb` or `rgba(...)`. */
export function colour(name) {
  const value = getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const pair = /^light-dark\((.*?\)?),\s*(.*)\)$/.exec(value);
  canvas.fillStyle = pair ? pair[isDark() ? 2 : 1] : value;
  return canvas.fillStyle;
}

/** Calls `listener` whenever the page changes between light and dark. */
export const onTheme = (listener) => listeners.add(listener);

preference.addEventListener("change", apply);
apply();
