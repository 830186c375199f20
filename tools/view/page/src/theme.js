// The colours of the page, light or dark as the system asks for: those of its style sheet, for what is drawn by scripts.

const wish = matchMedia("(prefers-color-scheme: dark)");

/** The value of a colour of the style sheet, such as `--line`. */
export const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

/** Calls `listener` whenever the system changes between light and dark. */
export const onTheme = (listener) => wish.addEventListener("change", listener);
