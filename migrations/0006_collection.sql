-- What jobs read and made, so that an artifact that nobody refers to is found without reading every job. No foreign key
-- to artifact: a job of an older server may name one that is long gone.
create table job_artifact (
    job      text not null references job (id),
    artifact text not null,
    primary key (job, artifact)
) strict, without rowid;

create index job_artifact_by_artifact on job_artifact (artifact);

create trigger job_names_what_it_reads after insert on job
begin
    insert or ignore into job_artifact
    select new.id, value from json_tree(new.spec)
    where type = 'text' and value glob 'sha256-*' and length(value) = 71;
end;

create trigger job_names_what_it_made after update of result on job
when new.result is not null
begin
    insert or ignore into job_artifact
    select new.id, value from json_tree(new.result)
    where type = 'text' and value glob 'sha256-*' and length(value) = 71;
end;

insert or ignore into job_artifact
select job.id, value from job, json_tree(job.spec)
where type = 'text' and value glob 'sha256-*' and length(value) = 71;

insert or ignore into job_artifact
select job.id, value from job, json_tree(job.result)
where type = 'text' and value glob 'sha256-*' and length(value) = 71;

-- When somebody last uploaded it, or was told that it need not be uploaded: its time of grace begins here.
alter table artifact add column use_time_ms integer not null default 0;
update artifact set use_time_ms = create_time_ms;

create index artifact_by_use on artifact (use_time_ms);
create index job_by_finish on job (finish_time_ms) where finish_time_ms is not null;
