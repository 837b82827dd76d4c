"""Hide the answers and commit to them, with the standard library alone.

The stream is HMAC-SHA256 of a counter under one key derived from the secret; a second derived key
authenticates what was written (encrypt, then authenticate). The commitment is the SHA-256 of the
plain answers, which carry a random salt, so that nobody can find them by trying.
"""

from __future__ import annotations

import hashlib
import hmac
import secrets

from wind_sensors.errors import UserError

KEY_BYTES = 32
NONCE_BYTES = 16
TAG_BYTES = 32


def new_key() -> bytes:
    """A random secret."""
    return secrets.token_bytes(KEY_BYTES)


def derive(key: bytes, purpose: str) -> bytes:
    """A key for one purpose, from which neither the secret nor another key can be found."""
    return hmac.new(key, purpose.encode(), hashlib.sha256).digest()


def commitment(plain: bytes) -> str:
    """What is printed beforehand: the SHA-256 of the salted answers, in hexadecimal."""
    return hashlib.sha256(plain).hexdigest()


def _stream(key: bytes, nonce: bytes, length: int) -> bytes:
    blocks = (length + 31) // 32
    parts = [
        hmac.new(key, nonce + i.to_bytes(8, "big"), hashlib.sha256).digest() for i in range(blocks)
    ]
    return b"".join(parts)[:length]


def _mix(one: bytes, other: bytes) -> bytes:
    return bytes(a ^ b for a, b in zip(one, other, strict=True))


def encrypt(key: bytes, plain: bytes) -> bytes:
    """Nonce, hidden text and tag."""
    nonce = secrets.token_bytes(NONCE_BYTES)
    hidden = _mix(plain, _stream(derive(key, "hide"), nonce, len(plain)))
    tag = hmac.new(derive(key, "authenticate"), nonce + hidden, hashlib.sha256).digest()
    return nonce + hidden + tag


def decrypt(key: bytes, sealed: bytes) -> bytes:
    """The plain text.

    Raises UserError if the key is not the one or the file was changed.
    """
    nonce, hidden, tag = sealed[:NONCE_BYTES], sealed[NONCE_BYTES:-TAG_BYTES], sealed[-TAG_BYTES:]
    expected = hmac.new(derive(key, "authenticate"), nonce + hidden, hashlib.sha256).digest()
    if not hmac.compare_digest(tag, expected):
        raise UserError(
            "the key does not open these answers, or the file was changed since it was sealed",
            "",
            "Give the key that `wind prove seal` printed or wrote.",
        )
    return _mix(hidden, _stream(derive(key, "hide"), nonce, len(hidden)))
