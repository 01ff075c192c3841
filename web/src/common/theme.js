// A colour of the page's own: --name of the style sheet, as it is now.
export const theme = (name) => getComputedStyle(document.documentElement).getPropertyValue('--' + name).trim();
