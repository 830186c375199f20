//! The iceoryx2 service variant of a run: its choice of mechanisms.

use iceoryx2_bb_elementary_traits::testing::abandonable::Abandonable;
use iceoryx2_bb_elementary_traits::zero_copy_send::ZeroCopySend;
use iceoryx2_cal::shm_allocator::{bump_allocator::BumpAllocator, pool_allocator::PoolAllocator};
use iceoryx2_cal::{
    bag, dynamic_storage, event, hash, monitoring, reactor, resizable_shared_memory, serialize,
    shared_memory, static_storage, zero_copy_connection,
};

use super::pool_allocated::PoolAllocated;

/// The iceoryx2 service variant of motorium. It uses the mechanisms of iceoryx2's `ipc::Service`, but lends
/// stream samples without heap allocation.
///
/// Standard iceoryx2 programs (`iox2`, the Python package) can access the same shared memory. Topics do not
/// use iceoryx2 events; motorium's `Trigger` wakes the components.
#[derive(Debug, Clone)]
pub struct Shared {}

impl iceoryx2::service::Service for Shared {
    type StaticStorage = static_storage::recommended::Ipc;
    type ConfigSerializer = serialize::recommended::Recommended;
    type PersistentDynamicStorage<T: core::fmt::Debug + Send + Sync + ZeroCopySend + 'static> =
        dynamic_storage::recommended::PersistentIpc<T>;
    type Bag = bag::recommended::Recommended;
    type DynamicStorage<T: core::fmt::Debug + Send + Sync + ZeroCopySend + 'static> =
        dynamic_storage::recommended::Ipc<T>;
    type ServiceNameHasher = hash::recommended::Recommended;
    type SharedMemory = shared_memory::recommended::Ipc<PoolAllocator>;
    type ResizableSharedMemory = resizable_shared_memory::recommended::Ipc<PoolAllocator>;
    type Connection = zero_copy_connection::recommended::Ipc;
    type Event = event::SemaphoreShmCountingBitSet;
    type Monitoring = monitoring::recommended::Ipc;
    type Reactor = reactor::recommended::Ipc;
    type ArcThreadSafetyPolicy<T: Send + core::fmt::Debug + Abandonable> = PoolAllocated<T>;
    type BlackboardMgmt<K: Send + Sync + core::fmt::Debug + ZeroCopySend + 'static> =
        dynamic_storage::recommended::Ipc<K>;
    type BlackboardPayload = shared_memory::recommended::Ipc<BumpAllocator>;
    type UniqueId = iceoryx2::unique_id_generator::unique_system_id::UniqueSystemId;
}

impl iceoryx2::service::internal::ServiceInternal<Shared> for Shared {}
