"""The explorer: one self-contained page that shows a whole study in a browser, without a network.

`page_data` gathers the contents of the page from a results file, `encode` turns arrays into compact
text, `page` combines them with `assets` (the page's own HTML, CSS and JavaScript) and `vendor`
(uPlot, the plotting library, under the MIT licence beside it).
"""
