//! Set-up of a component's helper threads, and of the descriptor that releases its steps.

use std::os::fd::AsFd;

use super::{ConfigureError, Setup, StopRequest};

impl Setup {
    /// Starts a helper thread for work that must not run in a step, such as printing, file access or slow
    /// devices.
    ///
    /// The thread runs at normal priority on the shared cores of the graph, under `name` (1 to 15 bytes). Its
    /// allocations do not count as allocations in steps. After the component has stopped, the thread receives
    /// a stop request and is joined. The request also interrupts a [`wait`](StopRequest::wait) or a blocking
    /// system call. The thread must end within half of the component's `stop_within`.
    ///
    /// ```
    /// use motorium::prelude::*;
    /// use crossbeam_channel::{Receiver, Sender, bounded};
    /// use std::time::Duration;
    ///
    /// /// Writes numbers to a file. A step hands them over by `try_send`, which never waits.
    /// fn writer(setup: &mut Setup) -> Result<Sender<f64>, ConfigureError> {
    ///     let (sender, receiver): (_, Receiver<f64>) = bounded(1_000);
    ///     setup.helper("writer", move |stop| loop {
    ///         let last_round = stop.wait(Duration::from_millis(20));
    ///         receiver.try_iter().for_each(|number| println!("{number}"));
    ///         if last_round {
    ///             return;
    ///         }
    ///     })?;
    ///     Ok(sender)
    /// }
    /// ```
    ///
    /// # Errors
    /// The name is empty or too long, or the system cannot create a thread.
    pub fn helper(
        &mut self,
        name: &str,
        run: impl FnOnce(&StopRequest) + Send + 'static,
    ) -> Result<(), ConfigureError> {
        let cores = self.plan().scheduling.shared_cores.clone();
        self.helpers.start(name, cores, run)
    }

    /// Sets the file descriptor, such as a socket or a CAN bus, that releases the steps of this component.
    /// The descriptor is only used if the graph sets `activate = { on = "fd", ... }`. The component must
    /// declare [`wakes_on_descriptor`](crate::declare::Declare::wakes_on_descriptor).
    ///
    /// A step is released while the descriptor is readable. Each step should read all available data without
    /// waiting, because unread data release a further step.
    ///
    /// ```
    /// use motorium::prelude::*;
    /// use std::net::UdpSocket;
    ///
    /// fn listen(setup: &mut Setup) -> Result<UdpSocket, ConfigureError> {
    ///     let socket = UdpSocket::bind("127.0.0.1:7400").map_err(ConfigureError::failed)?;
    ///     socket.set_nonblocking(true).map_err(ConfigureError::failed)?;
    ///     setup.wake_on(&socket)?;
    ///     Ok(socket)
    /// }
    /// ```
    ///
    /// # Errors
    /// The system cannot duplicate the descriptor.
    pub fn wake_on(&mut self, descriptor: &impl AsFd) -> Result<(), ConfigureError> {
        // Duplicated, because the component may close its own.
        let own = descriptor.as_fd().try_clone_to_owned().map_err(ConfigureError::failed)?;
        self.descriptor = Some(own);
        Ok(())
    }
}
