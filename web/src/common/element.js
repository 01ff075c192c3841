// Elements of a page. Text goes in as text, never as HTML.

/** @returns {HTMLElement} */
export function element(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name === 'style') made.style.cssText = value;
    else if (name.startsWith('on')) made.addEventListener(name.slice(2), value);
    else if (value != null) made.setAttribute(name, value);
  }
  made.append(...children.filter((child) => child != null));
  return made;
}

/** @param {string[][]} items a swatch's style and its words */
export function legend(items) {
  return element('p', {class: 'legend'}, ...items.map(([swatch, words]) =>
      element('span', {}, element('i', {style: swatch}), words)));
}

