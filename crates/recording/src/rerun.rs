//! The parts of Rerun's crates that recordings are made of.
//!
//! Crates that contact Rerun's servers, sign in there or gather statistics are left out: nothing here can reach another
//! machine.

pub(super) use ::rerun::{
    Archetype, AsComponents, ComponentDescriptor, ComponentIdentifier, DynamicArchetype, SerializedComponentBatch,
    archetypes::*,
    blueprint,
    components::{Color, FillMode, ImageFormat, MediaType, Radius, RotationQuat, Translation3D},
    datatypes::{ChannelDatatype, ColorModel, Quaternion, Range2D},
};
pub(super) use re_chunk::external::{arrow, re_byte_size};
pub(super) use re_chunk::{Chunk, ChunkError, ChunkId, RowId, TimeColumn};
pub(super) use re_log_types::{
    ApplicationId, BlueprintActivationCommand, EntityPath, EntityPathPart, LogMsg, SetStoreInfo, StoreId, StoreInfo,
    StoreKind, StoreSource, Timeline,
};
