// The book contains only the pages of docs/, so links to other files of the repository would be broken: each becomes a
// tooltip with the path of its file.
for (const link of document.querySelectorAll('main a[href^="../"]')) {
    link.title = `${link.getAttribute('href').replace('../', '')} in the repository`;
    link.removeAttribute('href');
}
