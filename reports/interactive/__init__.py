"""The report as one HTML file to look into: zoom, hover, one agent at a time; without a server and without a network.

What a plant file says reaches the page as text of elements (escaped by the serialiser) or as text of a chart, which
Plotly reads as a small markup and which is escaped for that.
"""
