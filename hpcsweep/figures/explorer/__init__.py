"""The explorer: one self-contained page that shows a whole study in a browser, without a network.

`study` gathers what the page shows from a results file, `pack` makes compact text of the arrays,
`page` puts them into one file together with `assets` (the page's own HTML, CSS and JavaScript)
and `vendor` (uPlot, the plotting library, under the MIT licence beside it).
"""
