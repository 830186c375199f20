//! Stock iceoryx2, as applications use it: `ipc::Service` with publish-subscribe, and an event to wake the
//! receiver.

use std::path::Path;

use iceoryx2::node::Node;
use iceoryx2::port::listener::Listener;
use iceoryx2::port::notifier::Notifier;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::{NodeBuilder, ServiceName, SignalHandlingMode, ipc};
use motorium::transport::Domain;

use super::link::Link;
use crate::payload::Payload;

/// A publish-subscribe and an event service per direction.
pub(super) struct Stock<P: Payload> {
    _node: Node<ipc::Service>,
    publisher: Publisher<ipc::Service, P, ()>,
    notifier: Notifier<ipc::Service>,
    subscriber: Subscriber<ipc::Service, P, ()>,
    listener: Listener<ipc::Service>,
}

impl<P: Payload> Stock<P> {
    pub(super) fn open(folder: &Path, side: usize) -> Result<Self, String> {
        motorium::transport::quieten();
        let run = folder.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        let domain = Domain::new(folder, &run).map_err(|error| error.to_string())?;
        let node = NodeBuilder::new()
            .config(domain.config())
            .signal_handling_mode(SignalHandlingMode::Disabled)
            .create::<ipc::Service>()
            .map_err(|error| error.to_string())?;
        let name = |kind: &str, side: usize| {
            ServiceName::new(&format!("{kind}/{side}")).map_err(|error| format!("{error:?}"))
        };
        let samples = |side| -> Result<_, String> {
            node.service_builder(&name("samples", side)?)
                .publish_subscribe::<P>()
                .subscriber_max_buffer_size(1)
                .open_or_create()
                .map_err(|error| error.to_string())
        };
        let events = |side| -> Result<_, String> {
            let builder = node.service_builder(&name("event", side)?).event();
            builder.open_or_create().map_err(|error| error.to_string())
        };
        let text = |error: &dyn core::fmt::Display| error.to_string();
        Ok(Self {
            publisher: samples(side)?.publisher_builder().create().map_err(|error| text(&error))?,
            notifier: events(side)?.notifier_builder().create().map_err(|error| text(&error))?,
            subscriber: samples(1 - side)?.subscriber_builder().create().map_err(|error| text(&error))?,
            listener: events(1 - side)?.listener_builder().create().map_err(|error| text(&error))?,
            _node: node,
        })
    }
}

impl<P: Payload> Link for Stock<P> {
    #[allow(unsafe_code)]
    fn send(&mut self, time_ns: u64) -> Result<(), String> {
        let sample = self.publisher.loan_uninit().map_err(|error| error.to_string())?;
        // SAFETY: the memory is mapped and every bit pattern is a valid payload; all of it is written next.
        let mut sample = unsafe { sample.assume_init() };
        sample.payload_mut().write(time_ns);
        sample.send().map_err(|error| error.to_string())?;
        self.notifier.notify().map_err(|error| error.to_string())?;
        Ok(())
    }

    fn receive(&mut self) -> Result<u64, String> {
        loop {
            if let Some(sample) = self.subscriber.receive().map_err(|error| error.to_string())? {
                return sample.payload().read().ok_or_else(|| "a payload was torn".to_string());
            }
            self.listener.blocking_wait(|_| {}).map_err(|error| error.to_string())?;
        }
    }
}
