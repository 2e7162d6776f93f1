"""HTTPS for the live page, by a certificate of the user.

Tested by ``test/dashboard/test_gate.py``.
"""

from __future__ import annotations

import ssl

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.limits import require_regular_file


def encryption(certificate: str, private_key: str) -> ssl.SSLContext | None:
    """What serves HTTPS; None without a certificate.

    Parameters
    ----------
    certificate, private_key : str
        PEM files; without a key it is taken from the file of the certificate.

    Raises
    ------
    ConfigurationError
        If they cannot be used together.
    """
    if not certificate:
        if private_key:
            raise ConfigurationError(
                'private_key', 'is given without a certificate', 'pass certificate, too'
            )
        return None
    for file in (certificate, private_key):
        if file:
            require_regular_file(file, ConfigurationError)
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    try:
        # A key behind a passphrase would ask for it in the middle of the start.
        context.load_cert_chain(certificate, private_key or None, password=lambda: '')
    except (OSError, ValueError) as error:
        raise ConfigurationError(
            'certificate',
            f'{certificate} cannot be used ({error.strerror or error})'
            if isinstance(error, OSError)
            else f'{certificate} cannot be used ({error})',
            'pass PEM files of a certificate and its key, without a passphrase',
        ) from error
    return context
