//! Places of open connections: a bounded number, and clients that have not shown the token keep nobody out.

use std::net::{Shutdown, TcpStream};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Most connections at a time.
const MOST: usize = 48;

/// Open connections, the oldest first.
#[derive(Default)]
pub(super) struct Guests(Mutex<Book>);

#[derive(Default)]
struct Book {
    /// Number of the next connection.
    next: u64,
    open: Vec<Guest>,
}

struct Guest {
    number: u64,
    /// To be shut where its place is needed.
    stream: TcpStream,
    /// It has shown the token.
    known: bool,
}

/// Place of a connection, which is free again when this is dropped.
pub(super) struct Place {
    guests: Arc<Guests>,
    number: u64,
}

impl Guests {
    /// A place for a connection. Where there is none, the oldest connection that has not shown the token makes way; `None` if
    /// all have.
    pub(super) fn admit(guests: &Arc<Self>, stream: &TcpStream) -> Option<Place> {
        let held = stream.try_clone().ok()?;
        let mut book = guests.lock();
        if book.open.len() >= MOST {
            let oldest = book.open.iter().position(|guest| !guest.known)?;
            let left = book.open.remove(oldest);
            let _ = left.stream.shutdown(Shutdown::Both);
        }
        let number = book.next;
        book.next += 1;
        book.open.push(Guest {
            number,
            stream: held,
            known: false,
        });
        drop(book);
        Some(Place {
            guests: guests.clone(),
            number,
        })
    }

    fn lock(&self) -> MutexGuard<'_, Book> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Place {
    /// Keeps the place: its client has shown the token.
    pub(super) fn keep(&self) {
        let mut book = self.guests.lock();
        let mine = book
            .open
            .iter_mut()
            .find(|guest| guest.number == self.number);
        if let Some(guest) = mine {
            guest.known = true;
        }
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        self.guests
            .lock()
            .open
            .retain(|guest| guest.number != self.number);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Read;
    use std::net::TcpListener;

    /// Unauthenticated connections are evicted, oldest first; authenticated ones stay; a dropped place is free.
    #[test]
    fn strangers_make_way_and_places_come_back() {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
        let address = listener.local_addr().expect("an address");
        let guests = Arc::new(Guests::default());
        let connect = || {
            let client = TcpStream::connect(address).expect("a connection");
            let (server, _) = listener.accept().expect("a connection");
            (client, Guests::admit(&guests, &server))
        };
        let mut all: Vec<_> = (0..MOST).map(|_| connect()).collect();
        all[0].1.as_ref().expect("a place").keep();
        let (_, place) = connect();
        assert!(place.is_some(), "a stranger makes way");
        assert_eq!(guests.lock().open.len(), MOST);
        // The second was the oldest stranger: its client reads the end.
        assert_eq!(all[1].0.read(&mut [0]).expect("an end"), 0);
        drop(place);
        assert_eq!(guests.lock().open.len(), MOST - 1);
        let (_, last) = connect();
        let last = last.expect("a place");
        last.keep();
        for (_, place) in &all {
            place.as_ref().expect("a place").keep();
        }
        assert!(connect().1.is_none(), "all are known");
        drop((all, last));
        assert!(guests.lock().open.is_empty());
    }
}
