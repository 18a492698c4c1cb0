"""The kit of all pages and pictures: reports, debugging, comparisons, overtaking, the friction lab, identification.

page            the page: one HTML file that loads nothing, on light and on dark, and the elements that pages share
table           a table, written as HTML, Markdown and CSV
bokeh_plots     plots that can be zoomed, in the colours of the page; they need bokeh
figures         pictures and figures on paper, in one style; they need matplotlib
"""
