// The keyboard: every key, what it does, and the page's own list of them.
import {element} from '../common/element.js';

/** @param {[string, string, (event: KeyboardEvent) => void][]} keys key (as KeyboardEvent.key), words, action */
export function listenToKeys(keys) {
  const names = {' ': 'space', ArrowLeft: '←', ArrowRight: '→'};
  const help = /** @type {HTMLDialogElement} */ (element('dialog', {'aria-label': 'keys'}, element('h2', {}, 'Keys'),
      element('dl', {class: 'keys'}, ...keys.flatMap(([key, words]) => [element('dt', {}, element('kbd', {}, names[key] ?? key)), element('dd', {}, words)])),
      element('form', {method: 'dialog'}, element('button', {}, 'Close'))));
  document.body.append(help);
  addEventListener('keydown', (event) => {
    const target = /** @type {HTMLElement} */ (event.target);
    if (event.ctrlKey || event.metaKey || event.altKey || target.matches('input:not([type=range]), textarea, dialog *')) return;
    // A button that has the focus is pressed by space itself.
    if (event.key === ' ' && target.matches('button, summary')) return;
    const found = keys.find(([key]) => key === event.key);
    if (!found) return;
    event.preventDefault();
    found[2](event);
  });
  return {toggle: () => (help.open ? help.close() : help.showModal())};
}
