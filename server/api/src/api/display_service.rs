//! The display service.

use super::caller::may_see;
use super::error::ApiError;
use super::field::Field;
use super::pages::Page;
use super::time::now_ms;
use super::{Api, displays, names, required};
use lightpath_proto::v1;
use lightpath_proto::v1::display_service_server::DisplayService;
use tonic::{Request, Response, Status};

#[tonic::async_trait]
impl DisplayService for Api {
    async fn create_display(
        &self,
        request: Request<v1::CreateDisplayRequest>,
    ) -> Result<Response<v1::Display>, Status> {
        let field = Field::new("display");
        let message = required(&field, request.into_inner().display)?;
        let display = displays::from_wire(message, &field)?;
        let (display, create_time_ms) = self.store.create_display(&display, now_ms()).await.map_err(ApiError::from)?;
        Ok(Response::new(displays::to_wire(display, create_time_ms)))
    }

    async fn get_display(&self, request: Request<v1::GetDisplayRequest>) -> Result<Response<v1::Display>, Status> {
        let id = names::display_id(&Field::new("name"), &request.into_inner().name)?;
        let (display, create_time_ms) = self.store.display(&id).await.map_err(ApiError::from)?;
        Ok(Response::new(displays::to_wire(display, create_time_ms)))
    }

    async fn list_displays(
        &self,
        request: Request<v1::ListDisplaysRequest>,
    ) -> Result<Response<v1::ListDisplaysResponse>, Status> {
        let request = request.into_inner();
        let page = Page::new(&["displays"], request.page_size, &request.page_token)?;
        let displays = self.store.displays(page.after.as_deref(), page.limit()).await.map_err(ApiError::from)?;
        let to_wire = |(display, time_ms)| displays::to_wire(display, time_ms);
        let (mut displays, next_page_token) = page.fill(displays, |(display, _)| display.id.clone(), to_wire);
        displays.retain(|display| display.name.strip_prefix("displays/").is_some_and(may_see));
        Ok(Response::new(v1::ListDisplaysResponse { displays, next_page_token }))
    }

    async fn plan_propagation(
        &self,
        request: Request<v1::PlanPropagationRequest>,
    ) -> Result<Response<v1::PlanPropagationResponse>, Status> {
        Ok(Response::new(self.plan(request.into_inner()).await?))
    }

    async fn delete_display(
        &self,
        request: Request<v1::DeleteDisplayRequest>,
    ) -> Result<Response<v1::DeleteDisplayResponse>, Status> {
        let id = names::display_id(&Field::new("name"), &request.into_inner().name)?;
        self.store.delete_display(&id).await.map_err(ApiError::from)?;
        Ok(Response::new(v1::DeleteDisplayResponse {}))
    }
}
