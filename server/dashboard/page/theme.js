// Light or dark: as the system says, or as the user chose.

const KEY = "lightpath-theme";
const system = matchMedia("(prefers-color-scheme: dark)");

function chosen() {
  try {
    return localStorage.getItem(KEY);
  } catch {
    return null; // A browser may forbid storage; the system's theme holds then.
  }
}

function isDark() {
  return document.documentElement.dataset.theme === "dark";
}

export function startTheme(button) {
  const apply = () => {
    const theme = chosen() ?? (system.matches ? "dark" : "light");
    document.documentElement.dataset.theme = theme;
    button.textContent = theme === "dark" ? "Light theme" : "Dark theme";
    dispatchEvent(new Event("themechange"));
  };
  button.addEventListener("click", () => {
    try {
      localStorage.setItem(KEY, isDark() ? "light" : "dark");
    } catch {
      // Without storage the choice lasts until the system changes.
    }
    apply();
  });
  system.addEventListener("change", apply);
  apply();
}
