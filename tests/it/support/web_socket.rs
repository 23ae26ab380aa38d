//! A WebSocket of which a test writes the bytes.

use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;

/// The first byte of a ping.
const PING: u8 = 0x89;

/// The first byte of a close frame, and of a text.
pub const CLOSE: u8 = 0x88;
pub const TEXT: u8 = 0x81;

/// Opens a connection and upgrades it to a WebSocket.
pub async fn open_websocket(address: &str) -> TcpStream {
    let mut socket = TcpStream::connect(address).await.unwrap();
    let request = format!(
        "GET /api/v1/assets/a/stream HTTP/1.1\r\nhost: {address}\r\nconnection: upgrade\r\n\
         upgrade: websocket\r\nsec-websocket-version: 13\r\n\
         sec-websocket-key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n"
    );
    socket.write_all(request.as_bytes()).await.unwrap();
    let mut head = Vec::new();
    while !head.ends_with(b"\r\n\r\n") {
        head.push(socket.read_u8().await.unwrap());
    }
    assert!(head.starts_with(b"HTTP/1.1 101 "), "{}", String::from_utf8_lossy(&head));
    socket
}

/// Returns the frame of a text with a masking key of zero.
pub fn frame(text: &[u8]) -> Vec<u8> {
    let mut frame = vec![TEXT];
    match u16::try_from(text.len()) {
        Ok(n) if n < 126 => frame.push(0x80 | u8::try_from(n).unwrap()),
        Ok(n) => {
            frame.push(0x80 | 126);
            frame.extend(n.to_be_bytes());
        }
        Err(_) => {
            frame.push(0x80 | 127);
            frame.extend((text.len() as u64).to_be_bytes());
        }
    }
    frame.extend([0; 4]);
    frame.extend(text);
    frame
}

/// Reads the next frame of the service that is not a ping: its kind and its content.
pub async fn read_frame(socket: &mut TcpStream) -> (u8, Vec<u8>) {
    loop {
        let [kind, length] = socket.read_u16().await.unwrap().to_be_bytes();
        let length = match length {
            126 => socket.read_u16().await.unwrap().into(),
            127 => usize::try_from(socket.read_u64().await.unwrap()).unwrap(),
            length => length.into(),
        };
        let mut content = vec![0; length];
        socket.read_exact(&mut content).await.unwrap();
        if kind != PING {
            return (kind, content);
        }
    }
}
