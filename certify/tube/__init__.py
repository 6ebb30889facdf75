"""Route "direct": kernels of the nominal loop and a comparison tube (theory.md section 6, docs/certificate-direct.md).

Everything here proposes: it works in floats with margins and writes witnesses down as short rationals. The checker
proves.
"""
