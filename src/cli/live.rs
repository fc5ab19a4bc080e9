//! A live view of the render in the image viewer tev.
//!
//! A thread of its own sends the pictures, so that a viewer that does not read never holds up the render: of the pictures
//! that wait only the newest is kept.

use anyhow::Context;
use opsr::image::Buffer;
use std::net::{TcpStream, ToSocketAddrs};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use tev_client::{PacketCreateImage, PacketUpdateImage, TevClient};

const CHANNELS: [&str; 3] = ["R", "G", "B"];

/// Longest wait for a viewer: to answer, to read some bytes, and to read the last picture.
const PATIENCE: Duration = Duration::from_secs(5);

/// A picture in a running tev.
pub(super) struct Live {
    newest: Arc<Mutex<Option<Buffer>>>,
    /// Wakes the thread; closed, it ends it.
    wake: SyncSender<()>,
    /// Closed by the thread when it ends.
    ended: Receiver<()>,
}

impl Live {
    /// Opens a black picture in the tev that listens at `address` (host:port).
    pub(super) fn open(address: &str, name: &str, picture: &Buffer) -> anyhow::Result<Self> {
        let stream = connect(address).with_context(|| format!("no tev listens at {address}"))?;
        let mut client = TevClient::wrap(stream);
        client
            .send(PacketCreateImage {
                image_name: name,
                grab_focus: false,
                width: picture.width as u32,
                height: picture.height as u32,
                channel_names: &CHANNELS,
            })
            .with_context(|| format!("tev at {address}"))?;
        let newest = Arc::new(Mutex::new(None));
        let (wake, woken) = sync_channel(1);
        let (end, ended) = sync_channel(0);
        let (name, waiting) = (name.to_owned(), newest.clone());
        std::thread::spawn(move || {
            let _end: SyncSender<()> = end;
            while woken.recv().is_ok() {
                let picture = waiting
                    .lock()
                    .unwrap_or_else(PoisonError::into_inner)
                    .take();
                if let Some(picture) = picture
                    && let Err(error) = send(&mut client, &name, &picture)
                {
                    tracing::warn!("tev does not read any more: {error}");
                    return;
                }
            }
        });
        Ok(Self {
            newest,
            wake,
            ended,
        })
    }

    /// Shows a picture as soon as the viewer has read the one before.
    pub(super) fn show(&self, picture: Buffer) {
        *self.newest.lock().unwrap_or_else(PoisonError::into_inner) = Some(picture);
        // A full queue wakes the thread as well; a closed one has warned.
        let _ = self.wake.try_send(());
    }

    /// Waits a little for the viewer to read the last picture.
    pub(super) fn finish(self) {
        drop(self.wake);
        let _ = self.ended.recv_timeout(PATIENCE);
    }
}

fn connect(address: &str) -> std::io::Result<TcpStream> {
    let mut error = std::io::Error::other("no such host");
    for address in address.to_socket_addrs()? {
        match TcpStream::connect_timeout(&address, PATIENCE) {
            Ok(stream) => {
                stream.set_write_timeout(Some(PATIENCE))?;
                return Ok(stream);
            }
            Err(e) => error = e,
        }
    }
    Err(error)
}

fn send(client: &mut TevClient, name: &str, picture: &Buffer) -> std::io::Result<()> {
    let data: Vec<f32> = picture.pixels.iter().flat_map(|p| p.to_array()).collect();
    client.send(PacketUpdateImage {
        image_name: name,
        grab_focus: false,
        channel_names: &CHANNELS,
        channel_offsets: &[0, 1, 2],
        channel_strides: &[3, 3, 3],
        x: 0,
        y: 0,
        width: picture.width as u32,
        height: picture.height as u32,
        data: &data,
    })
}
