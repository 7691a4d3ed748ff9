-- Whose artifacts are: who uploaded them, and whose jobs made them. Empty: nobody said.
create table artifact_owner (
    artifact text not null references artifact (digest) on delete cascade,
    owner    text not null check (length(owner) <= 128),
    primary key (artifact, owner)
) strict, without rowid;

-- What each owner has stored, so that nobody has to add it up. An artifact of two owners counts for both.
create table owner_bytes (
    owner text    not null primary key,
    bytes integer not null check (bytes >= 0)
) strict, without rowid;

create trigger artifact_is_somebodys after insert on artifact_owner
begin
    insert into owner_bytes select new.owner, size_bytes from artifact where digest = new.artifact
    on conflict do update set bytes = bytes + excluded.bytes;
end;

-- Before, because what goes with its artifact must still find how large that was.
create trigger artifact_is_nobodys before delete on artifact
begin
    update owner_bytes set bytes = bytes - old.size_bytes
    where owner in (select owner from artifact_owner where artifact = old.digest);
end;

-- What jobs made before this step belongs to who wanted it.
insert or ignore into artifact_owner
select job_artifact.artifact, job.owner from job
join job_artifact on job_artifact.job = job.id
join artifact on artifact.digest = job_artifact.artifact
where job.result is not null and instr(job.result, job_artifact.artifact) > 0;

-- How long the first job in turn of each kind has waited.
create index job_due_by_kind on job (kind, run_time_ms) where state = 'queued' and waiting_for = 0;
