-- Content-addressed blobs. The bytes are in files, or in objects of a bucket; a row exists only if its file is complete
-- and on disk, or its object is complete.
create table artifact (
    digest         text collate "C" not null primary key
                                    check (digest ~ '^sha256-[0-9a-f]{64}$'),
    size_bytes     bigint           not null check (size_bytes >= 0),
    create_time_ms bigint           not null,
    -- time of the last upload, or of the last request that found the artifact stored: its grace period starts here
    use_time_ms    bigint           not null
);

create index artifact_by_use on artifact (use_time_ms);

-- Artifacts whose objects are being removed from a bucket: they are no longer in the table `artifact`. Each removal has
-- a mark that was never used before. Who stores the same bytes meanwhile stores an object of its own, and ends the
-- removal if it still has the mark that was seen.
create table artifact_removal (
    digest text collate "C" not null primary key
                            check (digest ~ '^sha256-[0-9a-f]{64}$'),
    mark   text collate "C" not null check (length(mark) = 36)
);

-- Owners of artifacts: those who uploaded an artifact, and those whose jobs made it. Empty owner: unknown.
create table artifact_owner (
    artifact text collate "C" not null references artifact (digest) on delete cascade,
    owner    text collate "C" not null check (length(owner) <= 128),
    primary key (artifact, owner)
);

-- Size of the artifacts of each owner, kept up to date by the triggers below, so that no query must add it up. An
-- artifact with two owners counts for both. Owners without artifacts have no row.
create table owner_bytes (
    owner text collate "C" not null primary key,
    bytes bigint           not null check (bytes >= 0)
);

create function artifact_is_somebodys() returns trigger language plpgsql as $$
begin
    insert into owner_bytes select new.owner, size_bytes from artifact where digest = new.artifact
    on conflict (owner) do update set bytes = owner_bytes.bytes + excluded.bytes;
    return null;
end $$;

create trigger artifact_is_somebodys after insert on artifact_owner for each row
execute function artifact_is_somebodys();

-- The trigger runs before the delete, because it reads the size and the owners from rows that the delete removes.
create function artifact_is_nobodys() returns trigger language plpgsql as $$
begin
    update owner_bytes set bytes = bytes - old.size_bytes
    where owner in (select owner from artifact_owner where artifact = old.digest);
    delete from owner_bytes
    where bytes = 0 and owner in (select owner from artifact_owner where artifact = old.digest);
    return old;
end $$;

create trigger artifact_is_nobodys before delete on artifact for each row
execute function artifact_is_nobodys();

-- Where all artifacts are: the identity of a data folder or of a bucket. A server with another one must not use the
-- database.
create table artifact_place (
    -- so that there is one row at most
    id       bigint           not null primary key check (id = 1),
    identity text collate "C" not null check (length(identity) = 36)
);
