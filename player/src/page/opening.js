// Files of this device: chosen, or dropped on the page.

import { byId } from './element.js';

/** @param {(files: File[]) => void} open is given one or two files @returns {() => void} asks for files */
export function listenToFiles(open) {
  const input = byId('file', HTMLInputElement);
  const curtain = byId('drop');
  input.addEventListener('change', () => {
    take([...(input.files ?? [])]);
    input.value = '';
  });
  addEventListener('dragover', (event) => {
    event.preventDefault();
    curtain.hidden = false;
  });
  addEventListener('dragleave', (event) => {
    if (event.relatedTarget === null) curtain.hidden = true;
  });
  addEventListener('drop', (event) => {
    event.preventDefault();
    curtain.hidden = true;
    take([...(event.dataTransfer?.files ?? [])]);
  });
  return () => input.click();

  /** @param {File[]} files */
  function take(files) {
    if (files.length) open(files.slice(0, 2));
  }
}
