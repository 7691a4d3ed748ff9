-- Content-addressed blobs. The bytes are in files, or in objects of a bucket; a row exists only if its file is complete
-- and on disk, or its object is complete.
create table artifact (
    digest         text    not null primary key
                           check (length(digest) = 71 and digest glob 'sha256-*' and substr(digest, 8) not glob '*[^0-9a-f]*'),
    size_bytes     integer not null check (size_bytes >= 0),
    create_time_ms integer not null,
    -- time of the last upload, or of the last request that found the artifact stored: its grace period starts here
    use_time_ms    integer not null
) strict, without rowid;

create index artifact_by_use on artifact (use_time_ms);

-- Artifacts whose objects are being removed from a bucket: they are no longer in the table `artifact`. Each removal has
-- a mark that was never used before. Who stores the same bytes meanwhile stores an object of its own, and ends the
-- removal if it still has the mark that was seen.
create table artifact_removal (
    digest text not null primary key
                check (length(digest) = 71 and digest glob 'sha256-*' and substr(digest, 8) not glob '*[^0-9a-f]*'),
    mark   text not null check (length(mark) = 36)
) strict, without rowid;

-- Owners of artifacts: those who uploaded an artifact, and those whose jobs made it. Empty owner: unknown.
create table artifact_owner (
    artifact text not null references artifact (digest) on delete cascade,
    owner    text not null check (length(owner) <= 128),
    primary key (artifact, owner)
) strict, without rowid;

-- Size of the artifacts of each owner, kept up to date by the triggers below, so that no query must add it up. An
-- artifact with two owners counts for both. Owners without artifacts have no row.
create table owner_bytes (
    owner text    not null primary key,
    bytes integer not null check (bytes >= 0)
) strict, without rowid;

create trigger artifact_is_somebodys after insert on artifact_owner
begin
    insert into owner_bytes select new.owner, size_bytes from artifact where digest = new.artifact
    on conflict do update set bytes = bytes + excluded.bytes;
end;

-- The trigger runs before the delete, because it reads the size and the owners from rows that the delete removes.
create trigger artifact_is_nobodys before delete on artifact
begin
    update owner_bytes set bytes = bytes - old.size_bytes
    where owner in (select owner from artifact_owner where artifact = old.digest);
    delete from owner_bytes
    where bytes = 0 and owner in (select owner from artifact_owner where artifact = old.digest);
end;

-- Where all artifacts are: the identity of a data folder or of a bucket. A server with another one must not use the
-- database.
create table artifact_place (
    -- so that there is one row at most
    id       integer not null primary key check (id = 1),
    identity text not null check (length(identity) = 36)
) strict;
