// SPDX-License-Identifier: MIT
// Colours of the picture, for light and dark; those of the page stand in style.css.

const THEMES = {
  light: { background: 0xf4f2ee, fixed: 0xd3cfc6, grid: 0xb9b4a8, moving: 0x3f76b5, finger: 0xd9822b,
           proxy: 0x2f9e63, plane: 0x2f9e63, force: 0xc6362f, flash: 0xffb300, ghost: 0x6a4fb3,
           stripe: 0x8d877a, mark: 0xc6362f },
  dark: { background: 0x17191d, fixed: 0x3b3f47, grid: 0x545963, moving: 0x5d9be0, finger: 0xf2a154,
          proxy: 0x5fd399, plane: 0x5fd399, force: 0xff6b62, flash: 0xffd54f, ghost: 0xa98ff0,
          stripe: 0x7c828d, mark: 0xff6b62 },
};

const dark = matchMedia("(prefers-color-scheme: dark)");

export function palette() {
  return dark.matches ? THEMES.dark : THEMES.light;
}

export function onThemeChange(listener) {
  dark.addEventListener("change", listener);
}
