//! A live view of the render in the image viewer tev.

use anyhow::Context;
use opsr::image::Buffer;
use std::net::TcpStream;
use tev_client::{PacketCreateImage, PacketUpdateImage, TevClient};

const CHANNELS: [&str; 3] = ["R", "G", "B"];

/// A picture in a running tev.
pub(super) struct Live {
    client: TevClient,
    name: String,
}

impl Live {
    /// Opens a black picture in the tev that listens at `address` (host:port).
    pub(super) fn open(address: &str, name: &str, picture: &Buffer) -> anyhow::Result<Self> {
        let stream =
            TcpStream::connect(address).with_context(|| format!("no tev listens at {address}"))?;
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
        Ok(Self {
            client,
            name: name.to_owned(),
        })
    }

    /// Shows a picture.
    pub(super) fn show(&mut self, picture: &Buffer) -> anyhow::Result<()> {
        let data: Vec<f32> = picture.pixels.iter().flat_map(|p| p.to_array()).collect();
        self.client.send(PacketUpdateImage {
            image_name: &self.name,
            grab_focus: false,
            channel_names: &CHANNELS,
            channel_offsets: &[0, 1, 2],
            channel_strides: &[3, 3, 3],
            x: 0,
            y: 0,
            width: picture.width as u32,
            height: picture.height as u32,
            data: &data,
        })?;
        Ok(())
    }
}
