"""A mail server for the tests. Prints its port, then each mail as a line of JSON. With the
argument `refuse-first` it answers the first mail with a temporary error; a number is its port,
which the system chooses otherwise."""

import json
import sys

from aiosmtpd.controller import Controller
from aiosmtpd.smtp import AuthResult


class Receiver:
    def __init__(self, to_refuse):
        self.to_refuse = to_refuse

    async def handle_DATA(self, server, session, envelope):
        mail = {
            "from": envelope.mail_from,
            "to": envelope.rcpt_tos,
            "text": envelope.content.decode(),
            "user": session.auth_data.decode() if session.auth_data else None,
            "refused": self.to_refuse > 0,
        }
        print(json.dumps(mail), flush=True)
        if self.to_refuse > 0:
            self.to_refuse -= 1
            return "451 try again"
        return "250 taken"


def authenticate(server, session, envelope, mechanism, data):
    known = (data.login, data.password) == (b"ann", b"very-own-password")
    return AuthResult(success=known, auth_data=data.login)


receiver = Receiver(1 if "refuse-first" in sys.argv else 0)
controller = Controller(
    receiver,
    hostname="127.0.0.1",
    port=0,
    authenticator=authenticate,
    auth_require_tls=False,
    auth_required="auth" in sys.argv,
)
port = next((int(word) for word in sys.argv[1:] if word.isdigit()), 0)
# The port may be chosen by the system, so the controller's own check of it cannot be used.
import asyncio


async def main():
    loop = asyncio.get_running_loop()
    server = await loop.create_server(controller.factory, host="127.0.0.1", port=port)
    print(server.sockets[0].getsockname()[1], flush=True)
    await server.serve_forever()


asyncio.run(main())
