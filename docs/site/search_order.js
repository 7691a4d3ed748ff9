// Order of the results of the site's search: pages that say what to do come before pages that list everything. Sphinx puts this
// text into its search (`html_search_scorer`), and adds the numbers below to those of the words that were found.

/** What pages are worth, by the beginning of their names; the first line that fits counts. A word in a title is worth 15, one in the text 5. */
const PAGE_SCORES = [
  [/^docs\/(learn|recipes|scope|troubleshooting)/, 20],
  [/^docs\/(guide|concepts)|^client\/python\/README/, 15],
  [/^docs\/reference\/command-line/, 5],
  [/^docs\/(reference|decisions)/, -15],
  [/^docs\/(results|load|estimates|dependencies|compact-kernel)|^(ARCHITECTURE|CHANGELOG|CONTRIBUTING|bench|firmware)/, -5],
];

var Scorer = {
  score: ([page, , , , score]) => score + (PAGE_SCORES.find(([pages]) => pages.test(page))?.[1] ?? 5),
  // The numbers of Sphinx itself.
  objNameMatch: 11,
  objPartialMatch: 6,
  objPrio: { 0: 15, 1: 5, 2: -5 },
  objPrioDefault: 0,
  title: 15,
  partialTitle: 7,
  term: 5,
  partialTerm: 2,
};
