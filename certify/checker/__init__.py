"""The independent checker: decides whether a certificate proves its claim about a plant (docs/certificate.md).

It imports nothing of the project. See README.md for what has to be trusted.
"""

from certify.checker.checking import check
from certify.checker.verdict import Verdict

__all__ = ["Verdict", "check"]
