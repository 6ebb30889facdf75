"""Text for terminals whose encoding lacks some of our characters: ``alpha1`` where it has no ``α``."""

from __future__ import annotations

import codecs
import io
import re
import sys
import unicodedata

_GREEK = (
    "alpha beta gamma delta epsilon zeta eta theta iota kappa lambda mu nu xi omicron pi rho "
    "sigma tau upsilon phi chi psi omega"
).split()
_SMALL = [chr(code) for code in range(0x3B1, 0x3CA) if code != 0x3C2]  # without the final sigma
PLAIN = dict(zip(_SMALL, _GREEK, strict=True))
PLAIN |= {letter.upper(): name.capitalize() for letter, name in PLAIN.items()}
PLAIN |= {"ϖ": "varpi", "ϑ": "vartheta", "ς": "varsigma", "ϵ": "epsilon", "ϕ": "phi", "ℓ": "ell", "∞": "infinity"}
PLAIN |= {"≤": "<=", "≥": ">=", "≠": "!=", "≈": "~", "≡": "==", "→": "->", "←": "<-"}
PLAIN |= {"⪰": ">=", "⪯": "<=", "≻": ">", "≺": "<", "∈": "in", "∌": "lacks", "⊗": "x"}
PLAIN |= {"−": "-", "–": "-", "—": "-", "·": "*", "×": "x", "…": "...", "±": "+-", "√": "sqrt", "∛": "cbrt"}
PLAIN |= {"∂": "d", "∫": "integral ", "Σ": "sum ", "Π": "product ", "∇": "grad "}
PLAIN |= {"⌈": "[", "⌉": "]", "⌊": "[", "⌋": "]", "‖": "||"}
PLAIN |= {"ᵀ": "'", "′": "'", "“": '"', "”": '"', "‘": "'", "’": "'", "°": " deg", "⁄": "/", "•": "*"}
PLAIN |= {"\u0304": "_bar", "\u0302": "_hat", "\u0303": "_tilde", "\u0307": "'", "\u0301": "", "\u0308": ""}
PLAIN |= {power: f"^{digit}" for power, digit in zip("⁰¹²³⁴⁵⁶⁷⁸⁹⁻⁺ⁿ", "0123456789-+n", strict=True)}
_RAISED_TWICE = re.compile(r"(?<=\d|-)\^")
HANDLER = "consensus-certify.plain"


def plain(character: str) -> str:
    """One character in ASCII; an escape that JSON understands where there is no better one."""
    if character in PLAIN or character.isascii():
        return PLAIN.get(character, character)
    parts = unicodedata.normalize("NFKD", character)
    if parts != character:
        return "".join(map(plain, parts))
    units = character.encode("utf-16-be", "surrogatepass")
    return "".join(f"\\u{units[k : k + 2].hex()}" for k in range(0, len(units), 2))


def spell_out_what_is_missing() -> None:
    """From now on stdout and stderr write ``plain`` text for what their encodings lack."""
    codecs.register_error(HANDLER, _replaced)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper) and codecs.lookup(stream.encoding).name != "utf-8":
            stream.reconfigure(errors=HANDLER)


def _replaced(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    return _RAISED_TWICE.sub("", "".join(map(plain, error.object[error.start : error.end]))), error.end
