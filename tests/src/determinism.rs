use crate::material::{declare, hologram, request, target};
use crate::server::TestServer;
use lightpath::hologram_result;
use lightpath::v1::OptimizeHologramResult;

/// Columns and rows of the display. Neither the number of threads nor the tile size divides them evenly.
const SIZE_PX: (u32, u32) = (150, 98);

/// The result of one optimization with this many threads and workers.
async fn optimized(compute_threads: usize, workers: u32) -> OptimizeHologramResult {
    let server = TestServer::with(|config| {
        config.compute_threads = compute_threads;
        config.workers = workers;
    })
    .await;
    declare(&server.client, "lab", SIZE_PX.0, SIZE_PX.1).await;
    let target = server.client.upload_bytes(target(120, 120, 3)).await.unwrap();
    let job = server.client.submit(request(hologram("lab", &target, 40, 5), "")).await.unwrap();
    let job = server.client.wait(&job.name, |_| ()).await.unwrap();
    let result = hologram_result(&job).unwrap().clone();
    server.stop().await;
    result
}

#[tokio::test(flavor = "multi_thread")]
async fn number_of_compute_threads_does_not_change_the_bytes() {
    let one = optimized(1, 1).await;
    for threads in [2, 3] {
        let several = optimized(threads, 1).await;
        assert_eq!(one.wavelengths, several.wavelengths, "{threads} threads");
        let [one, several] = [&one, &several].map(|result| result.wavelengths[0].loss.to_bits());
        assert_eq!(one, several, "{threads} threads");
    }
}
