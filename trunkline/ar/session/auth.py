"""Who may come in: the page's own origin, and who knows the token or reads the terminal."""

import ipaddress
import secrets
from dataclasses import dataclass, field

TOKEN_BYTES = 16
CODE_DIGITS, CODE_SECONDS, CODE_TRIES = 6, 120.0, 5
LOCAL = ("127.0.0.1", "localhost", "[::1]")

HEADERS = {
    "Server": "trunkline",  # aiohttp's own has its version and Python's
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "Permissions-Policy": "xr-spatial-tracking=(self), camera=(), microphone=(), geolocation=()",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}


def make_token() -> str:
    """128 bits."""
    return secrets.token_urlsafe(TOKEN_BYTES)


def same(value: str, expected: str) -> bool:
    """In a time that tells nothing."""
    return secrets.compare_digest(value.encode(errors="surrogatepass"), expected.encode())


@dataclass
class PairingCode:
    """Six digits for a headset, where nobody types a token; `tries` left, `until` s."""

    digits: str = ""
    tries: int = 0
    until: float = 0.0

    def renew(self, now: float) -> str:
        """A new one, and the old one is worth nothing."""
        self.digits = f"{secrets.randbelow(10**CODE_DIGITS):0{CODE_DIGITS}d}"
        self.tries, self.until = CODE_TRIES, now + CODE_SECONDS
        return self.digits

    def fault(self, code: str, now: float) -> str:
        """Why `code` does not open, "" where it does; each call is a try, and what opened once does not again."""
        if not self.digits or now > self.until:
            return "code: it is over; ask for a new one at the server's terminal"
        self.tries -= 1
        right = same(code, self.digits)
        if right or self.tries <= 0:
            self.digits = ""
        return "" if right else f"code: wrong, {max(self.tries, 0)} tries left"


@dataclass(frozen=True)
class Origins:
    """The one place under which a server is known: `scheme`, `hosts` with their port. What comes under another name
    does not come in, so that a foreign page cannot reach it by a name of its own that resolves here."""

    scheme: str
    hosts: frozenset[str]
    origins: frozenset[str] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "origins", frozenset(f"{self.scheme}://{host}" for host in self.hosts))

    @classmethod
    def of(cls, names: list[str], port: int, tls: bool) -> "Origins":
        scheme, usual = ("https", 443) if tls else ("http", 80)
        hosts = {f"{name}:{port}" for name in names} | ({*names} if port == usual else set())
        return cls(scheme, frozenset(hosts))

    def fault(self, host: str | None, origin: str | None, needs_origin: bool) -> str:
        """Why a request with these headers is refused, "" where it is not."""
        if host not in self.hosts:
            return "host: not a name of this server"
        if origin is None and not needs_origin:
            return ""
        return "" if origin in self.origins else "origin: not this server's page"


def names_of(host: str) -> list[str]:
    """As which a server that listens at `host` is addressed."""
    if host in ("127.0.0.1", "localhost", "::1"):
        return list(LOCAL)
    try:
        address = ipaddress.ip_address(host)
    except ValueError:
        return [host, *LOCAL]
    return [f"[{host}]" if address.version == 6 else host, *LOCAL]


def is_local(host: str) -> bool:
    """Whether only this machine reaches a server that listens there."""
    return host in ("127.0.0.1", "localhost", "::1")
