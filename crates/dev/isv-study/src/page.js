// Tabs: arrow keys and clicks show one panel of a group.
for (const list of document.querySelectorAll('.tabs')) {
  const tabs = [...list.querySelectorAll('button')];
  const show = (chosen) => tabs.forEach((tab) => {
    tab.setAttribute('aria-selected', tab === chosen);
    tab.tabIndex = tab === chosen ? 0 : -1;
    document.getElementById(tab.getAttribute('aria-controls')).hidden = tab !== chosen;
  });
  tabs.forEach((tab, i) => {
    tab.addEventListener('click', () => show(tab));
    tab.addEventListener('keydown', (event) => {
      const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
      if (!step) return;
      const next = tabs[(i + step + tabs.length) % tabs.length];
      show(next);
      next.focus();
    });
  });
  show(tabs[0]);
}
// Pictures open large.
const dialog = document.querySelector('dialog');
for (const picture of document.querySelectorAll('.pair img, .sheet')) {
  picture.addEventListener('click', () => {
    dialog.querySelector('img').src = picture.src;
    dialog.querySelector('img').alt = picture.alt;
    dialog.showModal();
  });
}
dialog?.addEventListener('click', () => dialog.close());
